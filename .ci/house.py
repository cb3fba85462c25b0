#!/usr/bin/env python3
"""Counts the size and the English of the project and fails beyond a bound.

`.ci/house.py` prints every count with its bound; `.ci/house.py PATH…` lists the places below those
paths instead. The bounds of code lines, one for each crate, are the last column of the table of
crates in ARCHITECTURE.md; the other bounds are defined here. CONTRIBUTING.md says how a bound is
raised.

- A code line is a line of a tracked `.rs` file that is neither blank nor a line comment, outside of
  tests, fuzz targets, examples and benchmarks.
- A function's length runs from `fn` to its closing brace, in code lines' files.
- A tuple binding is `let (a, b) = (x, y);`, which hides two statements in one.
- A free relative clause is "what", "whatever", "whoever", "whichever" or "that which" in a comment
  or a page, except in questions.
- An indirect head is an item's documentation that begins with What, The same or Those.
- A circle is a set of files of one crate in which each uses, directly or indirectly, every other. A
  file uses the files whose items it names by a path (`crate::`, `super::`, `self::` or a module of
  its own), with imports and re-exports resolved to the file of the item. A re-export is not a use,
  nor is the name of an item of an enclosing module: the parts of a module share its vocabulary.
"""

import re
import subprocess
import sys

LONG, LONGEST = 80, 120
BOUNDS = {
    f"functions over {LONG} lines": 1,
    f"functions over {LONGEST} lines": 0,
    "tuple bindings per 1000 lines": 0.1,
    "free clauses per 1000 words": 0.1,
    "indirect heads in 100 items": 0.1,
    "files in circles": 50,
    "lines of ARCHITECTURE.md": 140,
    "lines of DECISIONS.md": 500,
    "lines of CHANGELOG.md": 80,
    "lines of README.md": 130,
}
TEST = re.compile(
    r"(^|/)(tests?|fuzz|examples)/|^benches/(src|round_trip)/|_tests?\.rs$|/tests\.rs$"
)
TESTS_INSIDE = re.compile(r"^#\[cfg\(test\)\]\n(?:#\[.*\n)*mod \w+ \{", re.M)
COMMENT = re.compile(r"^\s*//([/!]?) ?(.*)$")
FUNCTION = re.compile(
    r'( *)(?:pub(?:\([^)]*\))? )?(?:(?:const|unsafe|async|extern "C") )*fn \w'
)
TUPLE = re.compile(r"^\s*let \((?:mut )?\w+(?:, (?:mut )?\w+)+\)(?:: [^=]+)? = \(")
CLAUSE = re.compile(r"\b(?:what(?:ever)?|whoever|whichever|that which)\b", re.I)
HEAD = re.compile(r"(?:What|The same|Those)\b")
USE = re.compile(r"\b(pub(?:\([^)]*\))? )?use ([^;]+);")
GROUP = re.compile(r"((?:\w+::)+)\{([^{}]*)\}")
PATH = re.compile(r"(?<![\w:])\w+(?:::\w+)+")


def tracked(*patterns):
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *patterns]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return [path for path in listed.splitlines() if path.endswith((".rs", ".md"))]


def read(path):
    try:
        with open(path, encoding="utf-8") as file:
            return file.read()
    except FileNotFoundError:  # deleted and not yet committed
        return ""


def code(path, text):
    """The lines of a source file that count as code's, or none."""
    if not path.endswith(".rs") or TEST.search(path):
        return []
    inside = TESTS_INSIDE.search(text)
    return (text[: inside.start()] if inside else text).split("\n")


def functions(lines):
    """(line, length) of every function."""
    start = None
    for number, line in enumerate(lines, 1):
        head = FUNCTION.match(line)
        if head and start is None and not line.rstrip().endswith(";"):
            start = (number, head.group(1))
        elif start and line.rstrip() in (start[1] + "}", start[1] + "};"):
            yield start[0], number - start[0] + 1
            start = None


def prose(path, text):
    """(line, words) of every comment or line of a page."""
    fenced = False
    for number, line in enumerate(text.split("\n"), 1):
        if path.endswith(".rs"):
            comment = COMMENT.match(line)
            if comment:
                yield number, comment.group(2)
        elif line.startswith("```"):
            fenced = not fenced
        elif not fenced:
            yield number, line


def clauses(path, text):
    """Free clauses of a file: (line, sentence)."""
    joined, starts = "", []
    for number, words in prose(path, text):
        starts.append((len(joined), number))
        joined += words + " "
    offset = 0
    for sentence in re.split(r"(?<=[.?!:;])(?=\s)", joined):
        if not sentence.rstrip().endswith("?"):
            for clause in CLAUSE.finditer(sentence):
                place = offset + clause.start()
                yield max(n for at, n in starts if at <= place), sentence.strip()
        offset += len(sentence)


def heads(text):
    """(line, whether indirect) of the first line of every item's documentation."""
    before = ""
    for number, line in enumerate(text.split("\n"), 1):
        comment = COMMENT.match(line)
        kind = comment.group(1) if comment else ""
        if kind and kind != before:
            yield number, bool(HEAD.match(comment.group(2)))
        before = kind


def paths_of(path):
    """The paths in a source file as lists of words, and {name: path} of its imports."""
    lines = code(path, read(path))
    text = "\n".join(line for line in lines if not line.lstrip().startswith("//"))
    used, imports = PATH.findall(USE.sub("", text)), {}
    for exported, tree in USE.findall(text):
        while group := GROUP.search(tree):
            parts = (group[1] + part.strip() for part in group[2].split(",") if part.strip())
            tree = tree[: group.start()] + ", ".join(parts) + tree[group.end() :]
        for item in tree.split(", "):
            item, _, name = item.removesuffix("::self").partition(" as ")
            imports[name or item.split("::")[-1]] = item.split("::")
            used += [] if exported else [item]
    return [path.split("::") for path in set(used)], imports


def circles():
    """The circles of every crate, each as a list of its files."""
    for crate in budgets():
        files, parsed, uses, reached = {}, {}, {}, {}
        for path in tracked(f"{crate}/src"):
            name = path.removeprefix(f"{crate}/src/").removesuffix(".rs").removesuffix("/mod")
            module = () if name in ("lib", "main") else tuple(name.split("/"))
            if code(path, "") and module not in files:
                files[module], parsed[module] = path, paths_of(path)

        def found(module, path, depth=0):
            """The module of the item that a path in a module names; None for another crate's."""
            first, *rest = path
            imports = parsed[module][1]
            if first in ("crate", "self", "super"):
                module = {"crate": (), "self": module, "super": module[:-1]}[first]
            elif module + (first,) in files:
                module += (first,)
            elif first in imports and depth < 9:
                return found(module, imports[first] + rest, depth + 1)
            else:
                return module if depth else None
            return found(module, rest, depth + 1) if rest else module

        for module in files:
            named = {found(module, path) for path in parsed[module][0]} - {None}
            uses[module] = {other for other in named if module[: len(other)] != other}
        for module in files:
            ahead, reached[module] = [module], set()
            while ahead:
                new = uses[ahead.pop()] - reached[module]
                reached[module] |= new
                ahead += new
        back = {m: [o for o in files if o in reached[m] and m in reached[o]] for m in files}
        yield from ([files[o] for o in back[m]] for m in files if back[m] and back[m][0] == m)


def places(paths):
    """Every place below `paths` that counts against a bound."""
    for circle in circles():
        if any(path.startswith(tuple(paths)) for path in circle):
            yield f"{circle[0]}: circle: {' '.join(circle)}"
    for path in tracked(*paths):
        text = read(path)
        for number, sentence in clauses(path, text):
            yield f"{path}:{number}: free clause: {sentence}"
        if not path.endswith(".rs"):
            continue
        for number, line in enumerate(text.split("\n"), 1):
            if TUPLE.match(line):
                yield f"{path}:{number}: tuple binding: {line.strip()}"
        for number, indirect in heads(text):
            if indirect:
                yield f"{path}:{number}: indirect head"
        for number, length in functions(code(path, text)):
            if length > LONG:
                yield f"{path}:{number}: function of {length} lines"


def budgets():
    """{folder: most code lines} from the table of crates in ARCHITECTURE.md."""
    row = re.compile(r"^\| `([\w/]+)/` \| `sarrus-[\w-]+` \|.*\| ([\d,]+) \|$", re.M)
    return {folder: int(n.replace(",", "")) for folder, n in row.findall(read("ARCHITECTURE.md"))}


def counts():
    """{name: (count, bound)} of the whole project."""
    most = budgets()
    size = dict.fromkeys(most, 0)
    over = {LONG: 0, LONGEST: 0}
    lines = words = tuples = free = items = indirect = 0
    for path in tracked():
        text = read(path)
        words += sum(len(line.split()) for _, line in prose(path, text))
        free += sum(1 for _ in clauses(path, text))
        if not path.endswith(".rs"):
            continue
        lines += text.count("\n")
        tuples += sum(1 for line in text.split("\n") if TUPLE.match(line))
        found = [head for _, head in heads(text)]
        items += len(found)
        indirect += sum(found)
        source = code(path, text)
        n = sum(1 for line in source if line.strip() and not line.strip().startswith("//"))
        folders = [folder for folder in most if path.startswith(folder + "/")]
        if n and not folders:
            sys.exit(f"{path} belongs to no crate of the table in ARCHITECTURE.md")
        if n:
            size[max(folders, key=len)] += n
        for _, length in functions(source):
            over = {limit: count + (length > limit) for limit, count in over.items()}
    values = [over[LONG], over[LONGEST], 1000 * tuples / lines, 1000 * free / words]
    values += [100 * indirect / items, sum(map(len, circles()))]
    values += [read(name.split()[-1]).count("\n") for name in BOUNDS if name.endswith(".md")]
    table = {f"code lines of {folder}": (size[folder], most[folder]) for folder in most}
    table["code lines"] = (sum(size.values()), sum(most.values()))
    return table | {name: (value, BOUNDS[name]) for name, value in zip(BOUNDS, values)}


def main():
    if len(sys.argv) > 1:
        print(*places(sys.argv[1:]), sep="\n")
        return 0
    missed = False
    for name, (value, bound) in counts().items():
        beyond = value > bound
        missed |= beyond
        number = f"{value:9.2f}" if isinstance(value, float) else f"{value:6}   "
        print(f"{name:36} {number} at most {bound}{'  MISSED' if beyond else ''}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""The manual as an mdBook, from the texts that are there: `.ci/book.py sources FOLDER` writes its
sources, `.ci/book.py check FOLDER` fails for a built one with a broken link, a file from outside or
a page of 3 MB. `.ci/run pages` calls both.

A chapter is a page of the project, at the same path. Where a page names another one's path in code,
that becomes a link; so do names of documentation's modules. The table of fields, the closed forms
with their drawings, the programming interfaces side by side and the list of robots are made from
the sources that they describe.
"""

import ast
import html
import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

GUIDE = "server/dynamics/src/guide"
# (title, page), in the order of the book; deeper ones are below the one before
CHAPTERS = [
    ("sarrus", "README.md"),
    ("Tutorial", "server/docs/tutorial.md"),
    ("Robots to move", "gallery.md"),
    ("Robot files", "models/README.md"),
    ("- Closures of the bundled robots", "models/src/closures.md"),
    ("Notation", f"{GUIDE}/notation.md"),
    ("- Closed forms", f"{GUIDE}/closures.md"),
    ("- Derivatives", f"{GUIDE}/derivatives.md"),
    ("- Parameters", f"{GUIDE}/parameters.md"),
    ("- Motors", f"{GUIDE}/motors.md"),
    ("- Bibliography", f"{GUIDE}/bibliography.md"),
    ("Fields of requests", "fields.md"),
    ("Programming interfaces", "interfaces.md"),
    ("- Rust", "client/rust/README.md"),
    ("- Python", "client/python/README.md"),
    ("- C and C++", "client/c/README.md"),
    ("- Other languages", "client/README.md"),
    ("CAN bridge", "client/can/README.md"),
    ("Server", "server/README.md"),
    ("- As a library", "server/serve/README.md"),
    ("- Wire contract", "proto/README.md"),
    ("- Access rights", "SECURITY.md"),
    ("Generated code", "server/generate/README.md"),
    ("Pages", "server/show/README.md"),
    ("Simulation", "server/simulation/README.md"),
    ("Identification", "server/identify/README.md"),
    ("Report", "server/report/README.md"),
    ("Measured", "benches/README.md"),
    ("Dynamics as a library", "server/dynamics/README.md"),
    ("Architecture", "ARCHITECTURE.md"),
    ("- Contributing", "CONTRIBUTING.md"),
    ("- Decisions", "DECISIONS.md"),
    ("- Changes", "CHANGELOG.md"),
    ("- Releases", "RELEASING.md"),
]
BOOK = """[book]
title = "sarrus"
language = "en"

[build]
build-dir = "built"
create-missing = false

[output.html]
additional-css = ["book.css"]
smart-punctuation = false
input-404 = ""
playground = { runnable = false, copyable = true }
print = { enable = false }
search = { limit-results = 30 }
"""
STYLE = """img { max-width: 100%; background: #fff; border-radius: 8px; }
table { display: block; overflow-x: auto; }
"""
FENCE = re.compile(r"^\s*(```+|~~~+)")
REFERENCE = re.compile(r"""\b(href|src)="([^"]*)\"""")
LARGEST = 3_000_000


def read(path):
    return Path(path).read_text(encoding="utf-8")


def cells(*words):
    return "| " + " | ".join(word.replace("|", "\\|") for word in words) + " |\n"


def robots():
    """(name, path of its page) of every bundled robot."""
    pages = sorted(Path("models/robots").glob("*/README.md"))
    return [(page.parent.name, str(page)) for page in pages]


# --- pages made from sources ----------------------------------------------------------------------


def fields():
    """The table of `proto/src/fields.rs`."""
    table = read("proto/src/fields.rs")
    row = re.compile(r'^ {4}\w+ = \d+, "(\w+)", "([^"]*)", "([^"]*)",\s+"([^"]*)";', re.M)
    found = row.findall(table)
    assert len(found) == len(re.findall(r"^ {4}\w+ = \d+, ", table, re.M)), len(found)
    text = "# Fields of requests\n\nBlocks of numbers that requests give and answers hold, by the\n"
    text += "names that `sarrus ask` and all clients use. Symbols are those of [notation]"
    text += f"({GUIDE}/notation.md).\n\n" + cells("field", "shape", "unit", "meaning")
    text += cells(*["---"] * 4)
    for name, shape, unit, meaning in found:
        text += cells(f"`{name}`", shape, unit, meaning)
    return text


def closures():
    """The documentation of the closed forms, with their drawings."""
    text = ""
    for line in read(f"{GUIDE}/closures.rs").splitlines():
        drawing = re.match(r'#!\[doc = include_str!\("../../docs/(\w+).svg"\)\]', line)
        if drawing:
            text += f"\n![Drawing of {drawing[1]}](../../docs/{drawing[1]}.svg)\n\n"
        elif line.startswith("//!"):
            text += line[3:].removeprefix(" ") + "\n"
    return titled("Closed forms", text)


def titled(title, text):
    """A page with a title above its headings."""
    lines, fenced = [f"# {title}\n"], False
    for line in text.splitlines():
        fenced ^= bool(FENCE.match(line))
        lines.append("#" + line if line.startswith("#") and not fenced else line)
    return "\n".join(lines) + "\n"


def sentence(text):
    """The first sentence of a documentation, in one line."""
    text = re.sub(r"\[(`[^`]*`)\](\([^)]*\))?", r"\1", re.sub(r"\s+", " ", text).strip())
    return re.split(r"(?<=[.:])\s", text)[0].rstrip(".:")


def rust():
    """{(object, method): (signature, meaning)} of the Rust client."""
    found = {}
    for path in sorted(Path("client/rust/src").glob("*.rs")):
        of, doc = None, []
        for line in read(path).splitlines():
            if head := re.match(r"impl(?:<[^>]*>)? (\w+)", line):
                of = head[1]
            if comment := re.match(r"    /// ?(.*)", line):
                doc.append(comment[1])
            elif method := re.match(r"    pub fn (\w+)", line):
                if of in OBJECTS:
                    words = " ".join(doc).split(" # Errors")[0]
                    found[of, method[1]] = (f"{of}::{method[1]}", sentence(words))
                doc = []
            elif not line.startswith("    #["):
                doc = []
    return found


def python():
    """{(object, method): (signature, meaning)} of the Python package."""
    found = {}
    for path in ("robot.py", "query.py", "described.py", "_native.pyi"):
        tree = ast.parse(read(f"client/python/python/sarrus/{path}"))
        for of in filter(lambda node: isinstance(node, ast.ClassDef), tree.body):
            owner = "Robot" if of.name == "DescribedRobot" else of.name
            for method in filter(lambda node: isinstance(node, ast.FunctionDef), of.body):
                name = "connect" if method.name == "__init__" else method.name
                call = owner if method.name == "__init__" else f"{owner}.{name}"
                meaning = sentence((ast.get_docstring(method) or "").split("\n\n")[0])
                if owner not in OBJECTS or name.startswith("_"):
                    continue
                if not found.get((owner, name), ("", ""))[1]:
                    found[owner, name] = (call, meaning)
    return found


def c():
    """{(object, function): (name, meaning)} of the C header."""
    found = {}
    text = read("client/c/include/sarrus.h")
    function = r"/\*\*\n((?: \*[^\n]*\n)+?) \*/\n(?:SARRUS_MUST_USE\n)?[^\n(]*?\*?(sarrus_\w+)\("
    for doc, name in re.findall(function, text):
        of, _, rest = name.removeprefix("sarrus_").partition("_")
        if of.capitalize() in OBJECTS:
            meaning = sentence(re.sub(r"^ \* ?", "", doc, flags=re.M))
            found[of.capitalize(), rest] = (name, meaning)
    return found


OBJECTS = ("Robot", "Plan", "Query", "Controller", "Observer")
# other words for the same, by the word in the table
SAME = {"query": "prepare", "load_text": "from_text", "command": "send"}


def interfaces():
    """The functions of the three interfaces side by side."""
    columns = [rust(), python(), c()]
    assert all(len(column) > 15 for column in columns), [len(column) for column in columns]
    text = "# Programming interfaces\n\nThe same functions in Rust, Python and C, each with its\n"
    text += "first sentence; arguments are on the pages of [Rust](client/rust/README.md),\n"
    text += "[Python](client/python/README.md) and [C and C++](client/c/README.md). A name in one\n"
    text += "column alone is the language's own way, such as freeing memory.\n"
    for of in OBJECTS:
        rows = {}
        for k, column in enumerate(columns):
            for (owner, name), entry in column.items():
                if owner == of:
                    rows.setdefault(SAME.get(name, name), {}).setdefault(k, entry)
        text += f"\n## {of}\n\n" + cells("Rust", "Python", "C", "meaning") + cells(*["---"] * 4)
        for row in sorted(rows.values(), key=lambda row: (-len(row), sorted(row.items()))):
            names = [f"`{row[k][0]}`" if k in row else "" for k in range(3)]
            text += cells(*names, next((meaning for _, meaning in row.values() if meaning), ""))
    return text


def gallery():
    """The list of the robots, with their pages."""
    listed = re.findall(r'^ {4}"(\w+)": "([^"]+)",', read("models/src/bundled.rs"), re.M)
    about = {name: re.sub(r"\\\n\s*", "", words) for name, words in listed}
    text = "# Robots to move\n\nEach page moves one robot by sliders and needs no network; it is\n"
    text += "that of `sarrus show`. Two more have lengths as sliders: γ, G and the singular poses\n"
    text += "change with them.\n\n"
    text += "- [lambda elbow with editable lengths](gallery/lambda_lengths.html)\n"
    text += "- [2SPU+1U ankle with editable lengths](gallery/ankle_lengths.html)\n\n"
    text += cells("robot", "about") + cells("---", "---")
    for name, page in robots():
        text += cells(f"[move {name}](gallery/{name}.html)", f"[{name}]({page}) {about[name]}")
    return text


# --- chapters -------------------------------------------------------------------------------------


def linked(page, text, pages):
    """A page with links where it names another one."""
    up = "../" * page.count("/")

    def to_page(match):
        path = match[1] if match[1] in pages else str(Path(page).parent / match[1])
        return f"[{match[0]}]({up}{path})" if path in pages and path != page else match[0]

    def to_module(match):
        path = f"{GUIDE}/{match[2].split('::')[-1]}.md"
        return f"[{match[1]}]({up}{path})" if path in pages else match[1]

    lines, fenced = [], False
    for line in text.splitlines():
        fenced ^= bool(FENCE.match(line))
        if not fenced:
            line = re.sub(r"(?<!\[)`([\w./-]+\.md)`(?!\])", to_page, line)
            line = re.sub(r"\[([^\]]+)\]\(((?:crate|super|sarrus_\w+)::[\w:]+)\)", to_module, line)
            line = re.sub(r"\[(`[^`\]]+`)\](?!\()", r"\1", line)
            # files of the tree that are no pages keep their names alone
            line = re.sub(r"\[(`[^`\]]+`)\]\((?!http)[^)]*\.(?!md\b|html\b)\w+\)", r"\1", line)
            # the book's name of a folder's page
            line = re.sub(r"(\]\([^)]*?)README\.md(?=[)#])", r"\1index.md", line)
        lines.append(line)
    return "\n".join(lines) + "\n"


def sources(folder):
    """Writes the sources of the book."""
    made = {
        "gallery.md": gallery,
        "fields.md": fields,
        "interfaces.md": interfaces,
        f"{GUIDE}/closures.md": closures,
    }
    chapters = list(CHAPTERS)
    place = chapters.index(("Robots to move", "gallery.md")) + 1
    chapters[place:place] = [(f"- {name}", page) for name, page in robots()]
    pages = {page for _, page in chapters}
    summary = "# Summary\n\n"
    for title, page in chapters:
        text = made[page]() if page in made else read(page)
        if page.startswith(GUIDE) and page not in made:
            text = titled(title.removeprefix("- "), text)
        write(folder / "src" / page, linked(page, text, pages))
        indent = "    " if title.startswith("- ") else ""
        summary += f"{indent}- [{title.removeprefix('- ')}]({page})\n"
    write(folder / "src/SUMMARY.md", summary)
    write(folder / "book.toml", BOOK)
    write(folder / "book.css", STYLE)
    pictures = ["git", "ls-files", "server/docs/*.svg", "server/docs/*.gif", "server/dynamics/docs"]
    for path in subprocess.run(pictures, capture_output=True, text=True, check=True).stdout.split():
        target = folder / "src" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(Path(path).read_bytes())


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


# --- the built book -------------------------------------------------------------------------------


def check(folder):
    """Prints faults of a built book; whether there are any."""
    faults, links = [], 0
    texts = {path: read(path) for path in sorted(folder.rglob("*.html"))}
    anchors = {path: set(re.findall(r"""\bid="([^"]*)\"""", text)) for path, text in texts.items()}
    for path, text in texts.items():
        if len(text.encode()) >= LARGEST:
            faults.append(f"{path}: {len(text.encode())} bytes")
        # a script's texts are no elements
        plain = re.sub(r"<(script|style)\b([^>]*)>.*?</\1>", r"<\1\2></\1>", text, flags=re.S)
        for kind, found in REFERENCE.findall(plain):
            target = urlsplit(html.unescape(found))
            if target.scheme or target.netloc:
                if target.scheme != "data" and kind == "src":
                    faults.append(f"{path}: from outside: {found}")
                continue
            links += 1
            end = path.parent / unquote(target.path) if target.path else path
            end = Path(os.path.normpath(end))
            end = end / "index.html" if end.is_dir() else end
            if not end.exists():
                faults.append(f"{path}: no file {found}")
            elif target.fragment and end.suffix == ".html":
                if unquote(target.fragment) not in anchors.get(end, ()):
                    faults.append(f"{path}: no place {found}")
        for outside in re.findall(r"""<link\b[^>]*href="(https?:[^"]*)\"""", plain):
            faults.append(f"{path}: from outside: {outside}")
    print("\n".join(faults[:40] + [f"{len(texts)} pages, {links} links, {len(faults)} faults"]))
    return bool(faults) or len(texts) < len(CHAPTERS)


if __name__ == "__main__":
    command, place = sys.argv[1:]
    sys.exit(check(Path(place).resolve()) if command == "check" else sources(Path(place)))

//! The rooms of a crate use each other in one direction only, as ARCHITECTURE.md has it.
//!
//! A room is a module at the top of a crate. The section "Rooms" of the page lists folders of
//! sources. A table after a folder lists its rooms from low to high with the rooms that each may
//! use; without a table the rooms must have no circle. The uses of a file are the paths from
//! `crate` and `super` in its text, resolved to rooms, without comments and strings.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// One use of a room by a file.
#[derive(Debug)]
struct Use {
    /// Path from the folder of sources, and line.
    file: String,
    line: usize,
    /// Room of the file, and room that it uses.
    from: String,
    to: String,
}

/// The rooms of one folder of sources from low to high, each with the rooms that it may use.
struct Rooms {
    folder: String,
    allowed: Vec<(String, Vec<String>)>,
}

/// A word, a `::` or another sign, with its line.
type Token = (String, usize);

/// The tokens of a source without comments, strings and characters.
fn tokens(text: &str) -> Vec<Token> {
    let letters: Vec<char> = text.chars().collect();
    let mut found: Vec<Token> = Vec::new();
    let mut line = 1;
    let mut i = 0;
    let at = |i: usize| letters.get(i).copied().unwrap_or('\0');
    let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    while i < letters.len() {
        let start = i;
        match at(i) {
            '/' if at(i + 1) == '/' => i += letters[i..].iter().take_while(|x| **x != '\n').count(),
            '/' if at(i + 1) == '*' => {
                i += 2;
                while i < letters.len() && !(at(i) == '*' && at(i + 1) == '/') {
                    i += 1;
                }
                i += 2;
            }
            // r"…" and r#"…"#
            'r' if at(i + 1) == '"' || at(i + 1) == '#' && at(i + 2) == '"' => {
                let hash = at(i + 1) == '#';
                i += if hash { 3 } else { 2 };
                while i < letters.len() && !(at(i) == '"' && (!hash || at(i + 1) == '#')) {
                    i += 1;
                }
                i += if hash { 2 } else { 1 };
            }
            '"' => {
                i += 1;
                while i < letters.len() && at(i) != '"' {
                    i += if at(i) == '\\' { 2 } else { 1 };
                }
                i += 1;
            }
            // a character, not a lifetime
            '\'' if at(i + 1) == '\\' => {
                i += 3
                    + letters[(i + 3).min(letters.len())..]
                        .iter()
                        .take_while(|x| **x != '\'')
                        .count()
                    + 1
            }
            '\'' if at(i + 2) == '\'' => i += 3,
            ':' if at(i + 1) == ':' => {
                found.push(("::".into(), line));
                i += 2;
            }
            letter if is_word(letter) => {
                while is_word(at(i)) {
                    i += 1;
                }
                found.push((letters[start..i].iter().collect(), line));
            }
            letter => {
                if !letter.is_whitespace() {
                    found.push((letter.into(), line));
                }
                i += 1;
            }
        }
        line += letters[start..i.min(letters.len())].iter().filter(|x| **x == '\n').count();
    }
    found
}

/// The module of a file, by its path from the folder of sources.
fn module(path: &str) -> Vec<String> {
    let mut names: Vec<String> =
        path.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if matches!(names.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        names.pop();
    }
    names
}

/// The first names after `crate::` or the `super`s, at the token after the `::`.
fn first_names(tokens: &[Token]) -> Vec<Token> {
    match tokens.first() {
        Some((open, _)) if open == "{" => {
            // the names at depth one that begin an entry
            let mut depth = 0;
            let mut begins = true;
            let mut names = Vec::new();
            for token in tokens {
                match token.0.as_str() {
                    "{" => (depth, begins) = (depth + 1, depth == 0),
                    "}" => depth -= 1,
                    "," => begins = depth == 1,
                    _ if begins && depth == 1 => {
                        names.push(token.clone());
                        begins = false;
                    }
                    _ => {}
                }
                if depth == 0 {
                    break;
                }
            }
            names
        }
        Some(name) => vec![name.clone()],
        None => Vec::new(),
    }
}

/// The uses of other rooms by one file; `lib` is the top of the crate.
fn uses(path: &str, text: &str, rooms: &BTreeSet<String>) -> Vec<Use> {
    let tokens = tokens(text);
    let word = |i: usize| tokens.get(i).map_or("", |token: &Token| token.0.as_str());
    let own = module(path);
    let Some(from) = own.first().cloned() else { return Vec::new() };
    let mut inline: Vec<usize> = Vec::new();
    let mut depth = 0;
    let mut found = Vec::new();
    for i in 0..tokens.len() {
        match word(i) {
            "{" => {
                depth += 1;
                if i >= 2 && word(i - 2) == "mod" {
                    inline.push(depth);
                }
            }
            "}" => {
                if inline.last() == Some(&depth) {
                    inline.pop();
                }
                depth -= 1;
            }
            head @ ("crate" | "super")
                if word(i + 1) == "::" && (i == 0 || word(i - 1) != "::") =>
            {
                let mut next = i + 2;
                let mut above = own.len() + inline.len();
                if head == "super" {
                    above -= 1;
                    while word(next) == "super" && word(next + 1) == "::" {
                        (above, next) = (above - 1, next + 2);
                    }
                } else {
                    above = 0;
                }
                // the path stays inside its own room
                if above > 0 {
                    continue;
                }
                for (name, line) in first_names(&tokens[next..]) {
                    let to = if rooms.contains(&name) { name } else { "lib".to_owned() };
                    if to != from {
                        found.push(Use { file: path.to_owned(), line, from: from.clone(), to });
                    }
                }
            }
            _ => {}
        }
    }
    found
}

/// The uses that the table does not allow, as `file:line`.
fn violations(uses: &[Use], allowed: &[(String, Vec<String>)]) -> Vec<String> {
    let may = |found: &&Use| {
        allowed.iter().any(|(room, lower)| *room == found.from && lower.contains(&found.to))
    };
    let say = |found: &Use| {
        format!("{}:{}: `{}` may not use `{}`", found.file, found.line, found.from, found.to)
    };
    uses.iter().filter(|found| !may(found)).map(say).collect()
}

/// A circle of rooms if there is one: each uses the next, and the last uses the first.
fn circle(uses: &[Use]) -> Option<Vec<String>> {
    let mut next: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for found in uses {
        next.entry(&found.from).or_default().insert(&found.to);
    }
    // removes rooms without remaining uses until none is left
    loop {
        let rooms: BTreeSet<&str> = next.keys().copied().collect();
        let free: Vec<&str> =
            next.iter().filter(|(_, to)| to.is_disjoint(&rooms)).map(|(room, _)| *room).collect();
        if free.is_empty() {
            break;
        }
        next.retain(|room, _| !free.contains(room));
    }
    let mut path = vec![*next.keys().next()?];
    loop {
        let to = next[path[path.len() - 1]].iter().find(|room| next.contains_key(**room))?;
        if let Some(at) = path.iter().position(|room| room == to) {
            return Some(path[at..].iter().map(|room| (*room).to_owned()).collect());
        }
        path.push(to);
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// Every source below a folder, by its path from there.
fn sources(folder: &Path) -> Vec<(String, String)> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() { walk(&entry, found) } else { found.push(entry) }
        }
    }
    let mut found = Vec::new();
    walk(folder, &mut found);
    found.retain(|path| path.extension().is_some_and(|ending| ending == "rs"));
    found.sort();
    let name = |path: &PathBuf| path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
    found.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

/// True for files of tests only, which may use the whole crate.
fn is_test(path: &str) -> bool {
    path.split('/').any(|name| matches!(name, "tests" | "tests.rs"))
}

/// The uses between rooms in a folder, without the programs beside a library.
fn uses_of(folder: &Path) -> Vec<Use> {
    let mut files = sources(folder);
    files.retain(|(path, _)| !path.starts_with("bin/") && !is_test(path));
    let rooms = files.iter().filter_map(|(path, _)| module(path).first().cloned()).collect();
    files.iter().flat_map(|(path, text)| uses(path, text, &rooms)).collect()
}

/// The words in backticks.
fn quoted(text: &str) -> Vec<String> {
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The section "Rooms" of the page: folders as list items, tables below them.
fn table() -> Vec<Rooms> {
    let page = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let (_, section) = page.split_once("\n## Rooms\n").expect("no section `Rooms`");
    let mut found: Vec<Rooms> = Vec::new();
    for line in section.split("\n## ").next().unwrap().lines() {
        if line.starts_with("- `") {
            found.push(Rooms { folder: quoted(line).remove(0), allowed: Vec::new() });
        } else if let Some(row) = line.strip_prefix("| `") {
            let (room, lower) = row.split_once("` |").expect("a row of two columns");
            let rooms = found.last_mut().expect("a folder above the table");
            rooms.allowed.push((room.to_owned(), quoted(lower)));
        }
    }
    found
}

#[test]
fn rooms_use_lower_rooms_only() {
    let table = table();
    assert!(table.iter().any(|rooms| !rooms.allowed.is_empty()), "no table of rooms");
    for Rooms { folder, allowed } in &table {
        let uses = uses_of(&root().join(folder));
        let wrong = violations(&uses, allowed);
        assert!(wrong.is_empty(), "{folder}: {wrong:#?}");
        // the table has a room for each module and an order without circles
        let rooms: BTreeSet<String> = sources(&root().join(folder))
            .iter()
            .filter(|(path, _)| !is_test(path))
            .filter_map(|(path, _)| module(path).first().cloned())
            .collect();
        let named: BTreeSet<String> = allowed.iter().map(|(room, _)| room.clone()).collect();
        assert_eq!(rooms, named, "{folder}: rooms and those of the table");
        for (k, (room, lower)) in allowed.iter().enumerate() {
            let high = lower.iter().find(|name| !allowed[..k].iter().any(|(low, _)| low == *name));
            assert_eq!(high, None, "{folder}: `{room}` may use only what stands above it");
        }
        for (room, lower) in allowed {
            let unused =
                lower.iter().find(|low| !uses.iter().any(|x| x.from == *room && x.to == **low));
            assert_eq!(unused, None, "{folder}: `{room}` need not be allowed this");
        }
    }
}

#[test]
fn rooms_of_these_crates_use_each_other_in_no_circle() {
    let crates = [
        "proto",
        "models",
        "server",
        "server/dynamics",
        "server/report",
        "server/serve",
        "server/simulation",
        "client/rust",
        "client/can/core",
        "client/can/run",
        "client/can/sim",
        "client/can/cli",
        "client/python",
        "client/c",
        "benches",
    ];
    for name in crates {
        let uses = uses_of(&root().join(name).join("src"));
        assert_eq!(circle(&uses), None, "{name}: rooms use each other in a circle");
    }
}

#[test]
fn a_use_of_a_higher_room_is_found_with_its_line() {
    let rooms: BTreeSet<String> = ["scalar", "closure", "plan"].map(str::to_owned).into();
    let allowed = [("scalar", vec![]), ("closure", vec!["scalar".to_owned()])]
        .map(|(room, lower)| (room.to_owned(), lower));
    let check = |path: &str, text: &str| violations(&uses(path, text, &rooms), &allowed);
    let of = |line: usize| vec![format!("closure/bad.rs:{line}: `closure` may not use `plan`")];
    let bad = |text: &str| check("closure/bad.rs", text);
    assert_eq!(bad("//! Head.\nuse crate::plan::Plan;\n"), of(2));
    assert_eq!(bad("use crate::{\n    scalar::{Real, plan},\n    plan::{Plan, run},\n};\n"), of(3));
    assert_eq!(bad("use super::super::plan::Plan;\n"), of(1));
    assert_eq!(
        bad("fn f() {\n    let x: &'static str = \"}\";\n    crate::plan::run(x)\n}\n"),
        of(3)
    );
    assert_eq!(bad("mod tests {\n    use super::super::super::plan;\n}\n"), of(2));
    assert_eq!(bad("use crate::Plan;\n"), ["closure/bad.rs:1: `closure` may not use `lib`"]);
    // allowed uses, uses of the own room, and paths in comments and strings
    let fine = "use crate::scalar::Real; // use crate::plan::Plan;\nuse super::plan::Other;\n\
        /* crate::plan */ const X: &str = \"crate::plan\";\nmod tests { use super::super::Plan; }\n\
        pub(in crate::closure) fn f() { let c = '\\''; let d = '\"'; self::plan::x(c, d) }\n";
    assert_eq!(bad(fine), [""; 0]);
    // a room of one file has the crate's top as `super`
    assert_eq!(
        check("scalar.rs", "use super::closure;\n"),
        ["scalar.rs:1: `scalar` may not use `closure`"]
    );
}

#[test]
fn a_circle_of_rooms_is_found() {
    let rooms: BTreeSet<String> = ["a", "b", "c"].map(str::to_owned).into();
    let uses_in = |files: &[(&str, &str)]| {
        files.iter().flat_map(|(path, text)| uses(path, text, &rooms)).collect::<Vec<_>>()
    };
    let line = [("a.rs", "use crate::b::X;"), ("b/mod.rs", "use crate::c::Y;"), ("c.rs", "")];
    assert_eq!(circle(&uses_in(&line)), None);
    let round = [line[0], line[1], ("c.rs", "fn f() { super::a::g() }")];
    assert_eq!(circle(&uses_in(&round)), Some(["a", "b", "c"].map(str::to_owned).into()));
}

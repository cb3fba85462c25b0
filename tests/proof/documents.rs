//! The pages at the top of the project agree with the sources.

use std::fs;
use std::path::{Path, PathBuf};

use sarrus_models::{Options, Source, load};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn page(name: &str) -> String {
    let path = root().join(name);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Text between a heading of the second level and the next one.
fn section<'a>(page: &'a str, heading: &str) -> &'a str {
    let (_, rest) = page
        .split_once(&format!("\n## {heading}\n"))
        .unwrap_or_else(|| panic!("no heading `{heading}`"));
    rest.split("\n## ").next().unwrap()
}

/// The words in backticks outside blocks of code.
fn quoted(page: &str) -> Vec<&str> {
    page.split("```").step_by(2).flat_map(|prose| prose.split('`').skip(1).step_by(2)).collect()
}

/// The blocks of code in one language.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<&'a str> {
    page.split("```")
        .skip(1)
        .step_by(2)
        .filter_map(|block| block.strip_prefix(language)?.strip_prefix('\n'))
        .collect()
}

/// Files of a list: lines that begin with a path in backticks.
fn listed(section: &str) -> Vec<String> {
    section
        .lines()
        .filter_map(|line| Some(line.strip_prefix("- `")?.split_once('`')?.0.to_owned()))
        .collect()
}

/// All files of the project with this ending, as sorted paths from the root.
fn files(ending: &str) -> Vec<String> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = entry.file_name().unwrap().to_str().unwrap().to_owned();
            // hidden folders and build folders are not part of the project
            let is_built = name == "target" || entry.join("CACHEDIR.TAG").exists();
            if name.starts_with('.') || is_built {
                continue;
            }
            if entry.is_dir() { walk(&entry, found) } else { found.push(entry) }
        }
    }
    let mut found = Vec::new();
    walk(&root(), &mut found);
    let of_root = |path: &PathBuf| path.strip_prefix(root()).unwrap().to_str().unwrap().to_owned();
    let mut paths: Vec<String> =
        found.iter().map(of_root).filter(|path| path.ends_with(ending)).collect();
    paths.sort();
    paths
}

/// The value of `key = "value"` in a section of a manifest.
fn value(manifest: &str, section: &str, key: &str) -> Option<String> {
    let (_, rest) = manifest.split_once(&format!("[{section}]\n"))?;
    let line = rest
        .lines()
        .take_while(|line| !line.starts_with('['))
        .find_map(|line| line.strip_prefix(key)?.strip_prefix(" = "))?;
    Some(line.trim_matches('"').to_owned())
}

fn packages() -> Vec<String> {
    files("Cargo.toml").iter().filter_map(|path| value(&page(path), "package", "name")).collect()
}

#[test]
fn every_path_that_the_architecture_names_exists() {
    for name in ["ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let page = page(name);
        let is_path = |word: &&str| {
            let plain = word
                .chars()
                .all(|letter| letter.is_ascii_alphanumeric() || "_./-".contains(letter));
            plain
                && (word.contains('/')
                    || [".md", ".rs", ".toml"].iter().any(|ending| word.ends_with(ending)))
        };
        let paths: Vec<&str> = quoted(&page).into_iter().filter(is_path).collect();
        assert!(paths.len() > 1, "{name} names no paths");
        let missing: Vec<&str> =
            paths.into_iter().filter(|path| !root().join(path).exists()).collect();
        assert!(missing.is_empty(), "{name} names what is not there: {missing:?}");
    }
}

#[test]
fn every_crate_stands_in_the_architecture_with_its_folder() {
    let page = page("ARCHITECTURE.md");
    for path in files("Cargo.toml") {
        let (folder, Some(package)) =
            (path.trim_end_matches("Cargo.toml"), value(&self::page(&path), "package", "name"))
        else {
            continue;
        };
        assert!(
            page.contains(&format!("| `{folder}` | `{package}` |")),
            "{package} in {folder} has no row"
        );
    }
}

#[test]
fn unsafe_code_stands_only_where_it_is_listed() {
    // split, so that this file does not contain the words
    let [word, permission] = [concat!("un", "safe"), concat!("allow(un", "safe_code")];
    let is_letter = |letter: char| letter.is_alphanumeric() || letter == '_';
    let holds = |path: &String| {
        page(path).lines().filter_map(|line| line.split("//").next()).any(|code| {
            code.contains(permission)
                || code.split(|letter| !is_letter(letter)).any(|token| token == word)
        })
    };
    let found: Vec<String> = files(".rs").into_iter().filter(holds).collect();
    let mut listed = listed(section(&page("ARCHITECTURE.md"), "Unsafe code"));
    listed.sort();
    assert_eq!(found, listed, "found and listed differ");
    for path in ["server/dynamics/src/lib.rs", "models/src/lib.rs"] {
        assert!(
            page(path).contains(concat!("#![forbid(un", "safe_code)]")),
            "{path} does not forbid it"
        );
    }
}

#[test]
fn no_source_file_is_longer_than_600_lines() {
    let long: Vec<String> =
        files(".rs").into_iter().filter(|path| page(path).lines().count() > 600).collect();
    assert!(long.is_empty(), "{long:?}");
}

#[test]
fn every_closed_form_has_a_drawing_that_can_be_read() {
    let page = page("server/dynamics/src/guide/closures.rs");
    for kind in [
        "RRPR",
        "FOURBAR",
        "SLIDERCRANK",
        "PARALLELOGRAMCHAIN",
        "2SPU+1U",
        "2SPRR+1U",
        "2SURRPR+1U",
        "6UPS",
        "TRANSMISSION",
        "DIFFERENTIAL",
    ] {
        assert!(page.contains(&format!("//! # {kind}\n")), "no section {kind}");
        assert!(page.contains(&format!("//! | {kind} |")), "no row {kind}");
    }
    let drawings: Vec<String> =
        files("svg").into_iter().filter(|path| path.starts_with("server/dynamics/docs/")).collect();
    assert_eq!(drawings.len(), 11, "{drawings:?}");
    for path in drawings {
        let name = path.rsplit('/').next().unwrap();
        assert!(page.contains(&format!("docs/{name}\")")), "{name} is on no page");
        let drawing = std::fs::read_to_string(root().join(&path)).unwrap();
        // an empty line would end the drawing inside Markdown
        assert!(!drawing.contains("\n\n"), "{name} has an empty line");
        for size in drawing.split("font-size=\"").skip(1) {
            let size: f64 = size.split('"').next().unwrap().parse().unwrap();
            assert!(size >= 11.0, "{name}: text of {size} px");
        }
    }
}

#[test]
fn commands_on_the_pages_name_what_exists() {
    let packages = packages();
    let robots = sarrus_models::bundled().map(|(name, _)| name.to_owned()).collect::<Vec<_>>();
    for name in
        ["README.md", "CONTRIBUTING.md", "models/README.md", "proto/README.md", "server/README.md"]
    {
        let page = page(name);
        let lines = blocks(&page, "sh").into_iter().flat_map(str::lines).chain(quoted(&page));
        for command in lines.flat_map(|line| line.split('|')).map(str::trim) {
            let words: Vec<&str> =
                command.split_whitespace().take_while(|word| !word.starts_with('#')).collect();
            let after = |flag: &str| {
                words
                    .iter()
                    .position(|word| *word == flag)
                    .and_then(|at| words.get(at + 1))
                    .copied()
            };
            match words.first() {
                Some(&"cargo") => {
                    for package in ["-p", "--package"].iter().filter_map(|flag| after(flag)) {
                        assert!(
                            packages.iter().any(|name| name == package),
                            "{name}: no package {package} in `{command}`"
                        );
                    }
                }
                Some(&"sarrus") if words.len() > 1 => {
                    let commands = root().join("server/src/commands");
                    let exists = commands.join(words[1]).is_dir()
                        || commands.join(format!("{}.rs", words[1])).exists();
                    assert!(exists, "{name}: no command {} in `{command}`", words[1]);
                }
                _ => continue,
            }
            if let Some(robot) = after("--robot").filter(|robot| *robot != "NAME") {
                assert!(
                    robots.iter().any(|name| name == robot),
                    "{name}: no robot {robot} in `{command}`"
                );
            }
        }
    }
}

#[test]
fn the_first_page_is_one_page() {
    let page = page("README.md");
    assert!(page.lines().count() <= 120, "the README has {} lines", page.lines().count());
    let drawn =
        |line: &str| line.split_once("](").map(|(_, rest)| rest.trim_end_matches(')').into());
    let pictures: Vec<String> =
        page.lines().filter(|line| line.starts_with("![")).filter_map(drawn).collect();
    assert!(!pictures.is_empty(), "no picture on the first page");
    for path in &pictures {
        assert!(root().join(path).exists(), "the README shows {path}, which is not there");
    }
    let pages = quoted(&page).into_iter().filter(|word| word.ends_with(".md"));
    for path in pages {
        assert!(root().join(path).exists(), "the README leads to {path}, which is not there");
    }
}

#[test]
fn the_two_commands_are_on_the_first_page() {
    let page = page("README.md");
    for command in ["cargo run --release -- demo", "cargo test --release --workspace"] {
        assert!(
            blocks(&page, "sh").iter().any(|block| block.contains(command)),
            "the README lacks `{command}`"
        );
    }
    let server = value(&self::page("Cargo.toml"), "workspace", "default-members");
    assert_eq!(server.as_deref(), Some("[\"server\"]"), "`cargo run` must mean the server");
}

#[test]
fn versions_agree() {
    let workspace = page("Cargo.toml");
    let [version, rust] =
        ["version", "rust-version"].map(|key| value(&workspace, "workspace.package", key).unwrap());
    assert!(
        page("README.md").contains(&format!("Rust ≥ {rust}")),
        "the README asks for another Rust than {rust}"
    );
    let newest = page("CHANGELOG.md")
        .lines()
        .find_map(|line| line.strip_prefix("## [")?.split(']').next().map(str::to_owned));
    assert_eq!(
        newest.as_ref(),
        Some(&version),
        "the newest entry of the changelog is another version"
    );
    assert!(
        page("CITATION.cff").contains(&format!("\nversion: {version}\n")),
        "CITATION.cff is of another version than {version}"
    );
    for line in workspace.lines().filter(|line| line.starts_with("sarrus-")) {
        let other =
            line.contains("version = ") && !line.contains(&format!("version = \"{version}\""));
        assert!(!other, "a crate of the workspace is asked for in another version: {line}");
    }
    for path in files("Cargo.toml").iter().filter(|path| *path != "Cargo.toml") {
        let manifest = page(path);
        for line in [
            "version.workspace = true",
            "rust-version.workspace = true",
            "license.workspace = true",
            "[lints]\nworkspace = true",
        ] {
            assert!(manifest.contains(line), "{path} lacks `{line}`");
        }
    }
}

#[test]
fn the_robot_on_the_page_of_model_files_is_a_good_one() {
    let page = page("models/README.md");
    let [urdf, submechanisms] =
        ["xml", "yaml"].map(|language| blocks(&page, language).concat().into_bytes());
    let source = Source::Text { urdf, submechanisms: Some(submechanisms) };
    let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(loaded.report.warnings.is_empty(), "{:?}", loaded.report.warnings);
    let sizes = loaded.compiled.model.sizes();
    assert_eq!((sizes.n_v, sizes.n_vy, sizes.n_u, sizes.n_c), (3, 1, 1, 2));
}

#[test]
fn the_page_of_model_files_lists_every_bundled_robot_type_and_cut_joint() {
    let page = page("models/README.md");
    for (name, about) in sarrus_models::bundled() {
        let sizes = load(&Source::Bundled(name.into()), &Options::default())
            .unwrap_or_else(|error| panic!("{error}"))
            .compiled
            .model
            .sizes();
        let row = format!(
            "| `{name}` | {} | {} | {} | {} | {about} |",
            sizes.n_v, sizes.n_vy, sizes.n_u, sizes.n_c
        );
        assert!(page.contains(&row), "no row `{row}`");
    }
    for word in ["spherical", "weld", "revolute", "planar_revolute", "prismatic", "cylindrical"] {
        assert!(page.contains(&format!("| `{word}` |")), "no cut joint {word}");
    }
}

//! Public robots that are no part of the project, where a folder has them.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use super::run;

/// Outcome and hash of each file, by OWNER/NAME/PATH.
fn listed() -> BTreeMap<String, (String, String)> {
    let text = include_str!("../../corpus.tsv");
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split('\t').collect();
            let [outcome, repository, _, _, path, hash] = cells[..] else { panic!("{line}") };
            assert!(hash.len() == 64 && ["ok", "lenient", "refused"].contains(&outcome), "{line}");
            (format!("{repository}/{path}"), (outcome.to_owned(), hash.to_owned()))
        })
        .collect()
}

#[test]
fn public_robots_are_judged_as_the_list_has_them() {
    let listed = listed();
    assert!(listed.len() > 50, "{}", listed.len());
    let Some(folder) = std::env::var_os("SARRUS_CORPUS") else {
        println!("not run: SARRUS_CORPUS names no folder with public robots");
        return;
    };
    let folder = Path::new(&folder);
    let found = run(&["check", "--corpus", folder.to_str().unwrap()], b"");
    let outcomes: BTreeMap<&str, &str> = found
        .out
        .lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            let outcome = words.next()?;
            words.next().map(|path| (path, outcome))
        })
        .collect();
    let mut count = 0;
    for (path, (expected, hash)) in &listed {
        let sum = Command::new("sha256sum").arg(folder.join(path)).output().unwrap();
        if !String::from_utf8_lossy(&sum.stdout).starts_with(hash) {
            println!("{path}: another version, or not there");
            continue;
        }
        assert_eq!(outcomes.get(path.as_str()), Some(&expected.as_str()), "{path}");
        count += 1;
    }
    println!("{count} of {} files", listed.len());
    assert!(count > 0, "{} has none of the listed files", folder.display());
}

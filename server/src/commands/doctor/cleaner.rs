//! The cleaner of temporary folders: systemd-tmpfiles removes old files, also of a running server.

use std::collections::BTreeMap;
use std::path::Path;

use sarrus_proto::Domain;

use super::Finding;
use super::files::Files;

pub(super) fn cleaner(files: &Files) -> Vec<Finding> {
    let Ok(domain) = Domain::of_user() else { return Vec::new() };
    // a file replaces those of the same name in earlier folders
    let mut texts = BTreeMap::new();
    for folder in ["usr/lib/tmpfiles.d", "run/tmpfiles.d", "etc/tmpfiles.d"] {
        for name in files.names(folder).into_iter().filter(|name| name.ends_with(".conf")) {
            let text = files.text(&format!("{folder}/{name}")).unwrap_or_default();
            texts.insert(name, text);
        }
    }
    judge(domain.root(), &texts.into_values().collect::<Vec<String>>())
}

/// A line of a configuration of systemd-tmpfiles.
struct Rule<'a> {
    kind: char,
    path: &'a str,
    age: Option<&'a str>,
}

impl Rule<'_> {
    fn read(line: &str) -> Option<Rule<'_>> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let kind = words.first()?.chars().next().filter(|kind| *kind != '#')?;
        Some(Rule { kind, path: words.get(1)?, age: words.get(5).copied() })
    }

    fn spares(&self, root: &str) -> bool {
        matches!(self.kind, 'x' | 'X')
            && match self.path.strip_suffix('*') {
                Some(start) => root.starts_with(start),
                None => root == self.path,
            }
    }

    /// Whether the rule removes old files of a folder above the root.
    fn clears(&self, root: &Path) -> bool {
        matches!(self.kind, 'd' | 'D' | 'e' | 'q' | 'Q' | 'v')
            && self.age.is_some_and(|age| age != "-" && age != "0")
            && self.path != "/"
            && root.starts_with(self.path)
    }
}

fn judge(root: &Path, texts: &[String]) -> Vec<Finding> {
    let rules = || texts.iter().flat_map(|text| text.lines()).filter_map(Rule::read);
    let root_text = root.to_string_lossy();
    if rules().any(|rule| rule.spares(&root_text)) {
        return Vec::new();
    }
    let Some(Rule { path, age: Some(age), .. }) = rules().find(|rule| rule.clears(root)) else {
        return Vec::new();
    };
    vec![Finding::new(
        "cleaner",
        format!("systemd-tmpfiles removes from {path} what is older than {age}"),
        format!("{root_text} left alone"),
        format!(
            "a line `x {root_text}*` in /etc/tmpfiles.d/sarrus.conf, or a folder elsewhere in \
             SARRUS_ROOT"
        ),
    )]
}

#[cfg(test)]
mod tests {
    use super::super::tests::judge as judge_files;
    use super::*;

    #[test]
    fn a_cleaner_of_a_folder_above_is_found_unless_it_spares_ours() {
        let judge = |root: &str, texts: &[&str]| {
            let texts: Vec<String> = texts.iter().map(|text| (*text).to_owned()).collect();
            super::judge(Path::new(root), &texts)
        };
        let system = "# comment\nq /tmp 1777 root root 10d\nq /var/tmp 1777 root root 30d\n";
        let found = judge("/tmp/sarrus-7", &[system]);
        assert_eq!(found[0].found, "systemd-tmpfiles removes from /tmp what is older than 10d");
        assert_eq!(judge("/tmp/sarrus-7", &[system, "x /tmp/sarrus-*\n"]), []);
        assert_eq!(judge("/run/user/7/sarrus", &[system]), []);
        assert_eq!(judge("/tmp/sarrus-7", &["D /tmp 1777 root root -\n"]), []);
        assert_eq!(judge("/tmp/sarrus-7", &["q /tmp", "", "\u{0}\n1 2 3 4 5 6 7"]), []);
    }

    #[test]
    fn the_administrators_file_takes_the_place_of_the_systems() {
        let files = [
            ("usr/lib/tmpfiles.d/tmp.conf", "q /tmp 1777 root root 10d\nq / 0755 - - 1d\n"),
            ("etc/tmpfiles.d/tmp.conf", "q /tmp 1777 root root -\n"),
        ];
        assert_eq!(judge_files(cleaner, &files), [""; 0]);
    }
}

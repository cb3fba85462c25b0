//! Names in messages: quoted, and the known name that a misspelt one most likely means.

use strsim::osa_distance;

/// Longest name that is compared, and most names that are compared with one: a hostile file must
/// not cost seconds.
const LONGEST: usize = 64;
const MOST: usize = 4096;

/// A name for a message: in backticks, shortened when long, control characters made visible.
pub fn quoted(name: &str) -> String {
    const LONGEST: usize = 60;
    let start: String = name.chars().take(LONGEST).collect();
    let rest = if name.chars().nth(LONGEST).is_some() { "…" } else { "" };
    format!("`{}{rest}`", visible(&start))
}

/// A text for a message, on one line: control characters made visible.
pub(crate) fn visible(text: &str) -> String {
    let shown =
        |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    text.chars().map(shown).collect()
}

/// The known name with the least edit distance to `name`, letter case ignored; `None` if none is
/// close.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let count = |text: &str| text.chars().count();
    let letters = folded(name)?;
    let mut best: Option<((usize, bool), &str)> = None;
    for candidate in known.into_iter().take(MOST) {
        // a third of the letters may differ
        let most = best.map_or(count(&letters).max(3) / 3, |((distance, _), _)| distance);
        let Some(other) = folded(candidate) else { continue };
        // a subscript that is missing counts as one letter, and less than another letter
        let rest = other.strip_prefix(&letters);
        let goes_on = rest.is_some_and(|rest| rest.starts_with('_'));
        if !goes_on && count(&letters).abs_diff(count(&other)) > most {
            continue;
        }
        let distance = if goes_on { 1 } else { osa_distance(&letters, &other) };
        let rank = (distance, !goes_on);
        if distance <= most && best.is_none_or(|(least, _)| rank < least) {
            best = Some((rank, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// " (there is `NAME`)" with the nearest known name; empty if none is close.
pub(crate) fn there_is<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let near = nearest(name, known).map(quoted);
    near.map_or(String::new(), |near| format!(" (there is {near})"))
}

/// The known names for a message, the nearest first, as many as fit into this many characters.
pub fn nearest_first<'a>(
    name: &str,
    known: impl IntoIterator<Item = &'a str>,
    most: usize,
) -> String {
    let letters = folded(name).unwrap_or_default();
    let far =
        |other: &str| folded(other).map_or(usize::MAX, |other| osa_distance(&letters, &other));
    let mut names: Vec<&str> = known.into_iter().collect();
    if names.len() <= MOST {
        names.sort_by_cached_key(|other| far(other));
    }
    listed(names, most)
}

/// Names for a message in their order, as many as fit into this many characters.
pub(crate) fn listed<'a>(names: impl IntoIterator<Item = &'a str>, most: usize) -> String {
    let mut list = String::new();
    let mut length = 0;
    let mut left = 0_usize;
    for name in names {
        let with = length + name.chars().count() + 2;
        if left > 0 || with > most {
            left += 1;
            continue;
        }
        if length > 0 {
            list.push_str(", ");
        }
        list.push_str(name);
        length = with;
    }
    match (list.is_empty(), left) {
        (_, 0) => list,
        (true, _) => format!("{left} names"),
        _ => format!("{list} and {left} more"),
    }
}

/// Lower-case letters of a name that is short enough to compare.
fn folded(name: &str) -> Option<String> {
    (name.len() <= LONGEST).then(|| name.chars().flat_map(char::to_lowercase).collect())
}

#[cfg(test)]
mod tests {
    use super::{nearest, nearest_first};

    #[test]
    fn a_slip_finds_its_name_and_a_stranger_finds_none() {
        let known = ["jointnames_active", "jointnames", "type", "name"];
        assert_eq!(nearest("jointnames_actve", known), Some("jointnames_active"));
        assert_eq!(nearest("TYPE", known), Some("type"));
        assert_eq!(nearest("tpye", known), Some("type"));
        assert_eq!(nearest("damping", known), None);
        // a subscript is forgotten more easily than the letter is mistaken
        assert_eq!(nearest("M", ["y", "q", "M_y"]), Some("M_y"));
        assert_eq!(nearest("cond", ["conds_Kd", "cond_Kd"]), Some("cond_Kd"));
        assert_eq!(nearest(&"x".repeat(1 << 20), known), None);
    }

    #[test]
    fn a_list_of_names_begins_with_the_nearest_and_is_bounded() {
        let known = ["base", "left_arm", "right_arm", "head"];
        assert_eq!(nearest_first("haed", known, 300), "head, base, left_arm, right_arm");
        assert_eq!(nearest_first("left_am", known, 20), "left_arm and 3 more");
        assert_eq!(nearest_first("x", ["a_long_name"], 5), "1 names");
        assert_eq!(nearest_first("x", [], 5), "");
    }
}

//! The known name that a misspelt one most likely means.

/// Longest name that is compared, and most names that are compared with one: a hostile file must
/// not cost seconds.
const LONGEST: usize = 64;
const MOST: usize = 4096;

/// The known name with the least edit distance to `name`, letter case ignored; `None` when all are
/// far.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let letters = folded(name)?;
    let mut best: Option<(usize, &str)> = None;
    for candidate in known.into_iter().take(MOST) {
        // a third of the letters may differ
        let most =
            best.map_or(letters.len().max(3) / 3, |(distance, _)| distance.saturating_sub(1));
        let Some(other) = folded(candidate) else { continue };
        if letters.len().abs_diff(other.len()) > most {
            continue;
        }
        let distance = edit_distance(&letters, &other);
        if distance <= most && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Lower-case letters of a name that is short enough to compare.
fn folded(name: &str) -> Option<Vec<char>> {
    (name.len() <= LONGEST).then(|| name.chars().flat_map(char::to_lowercase).collect())
}

/// Least number of insertions, deletions, replacements and swaps of neighbours that turn `a` into
/// `b`.
fn edit_distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = last;
        last = row;
    }
    last.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn a_slip_finds_its_name_and_a_stranger_finds_none() {
        let known = ["jointnames_active", "jointnames", "type", "name"];
        assert_eq!(nearest("jointnames_actve", known), Some("jointnames_active"));
        assert_eq!(nearest("TYPE", known), Some("type"));
        assert_eq!(nearest("tpye", known), Some("type"));
        assert_eq!(nearest("damping", known), None);
        assert_eq!(nearest(&"x".repeat(1 << 20), known), None);
    }
}

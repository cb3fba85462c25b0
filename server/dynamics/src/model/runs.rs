//! Indices into a list of the model, as runs of neighbours.

use core::ops::Range;

/// Ascending indices into one of the model's lists, as runs. Bodies are numbered depth first: the
/// whole robot is one run, and so is the subtree of a joint. A run is a slice, so loops need no
/// look-up per element.
#[derive(Clone, Debug, Default)]
pub(crate) struct Runs(Vec<Range<usize>>);

impl Runs {
    /// The indices that are marked.
    pub(crate) fn marked(marks: &[bool]) -> Runs {
        (0..marks.len()).filter(|i| marks[*i]).collect()
    }

    /// Each run, ascending.
    #[inline(always)]
    pub(crate) fn runs(&self) -> impl DoubleEndedIterator<Item = Range<usize>> {
        self.0.iter().cloned()
    }

    /// Each index, ascending.
    pub(crate) fn indices(&self) -> impl DoubleEndedIterator<Item = usize> {
        self.runs().flatten()
    }

    /// Number of indices.
    pub(crate) fn count(&self) -> usize {
        self.0.iter().map(Range::len).sum()
    }

    /// True if there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// True for one of the indices.
    pub(crate) fn contains(&self, place: usize) -> bool {
        let after = self.0.partition_point(|run| run.start <= place);
        after > 0 && self.0[after - 1].contains(&place)
    }
}

/// From ascending indices.
impl FromIterator<usize> for Runs {
    fn from_iter<I: IntoIterator<Item = usize>>(indices: I) -> Runs {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for place in indices {
            match runs.last_mut() {
                Some(run) if run.end == place => run.end += 1,
                _ => runs.push(place..place + 1),
            }
        }
        Runs(runs)
    }
}

#[cfg(test)]
mod tests {
    use super::Runs;

    #[test]
    fn neighbours_are_one_run_and_every_place_is_kept() {
        let indices = [1, 2, 3, 7, 9, 10];
        let runs: Runs = indices.into_iter().collect();
        assert_eq!(runs.runs().collect::<Vec<_>>(), [1..4, 7..8, 9..11]);
        assert_eq!(runs.indices().collect::<Vec<_>>(), indices);
        assert_eq!(runs.count(), indices.len());
        let contained: Vec<usize> = (0..12).filter(|i| runs.contains(*i)).collect();
        assert_eq!(contained, indices);
        assert!(Runs::marked(&[false; 3]).is_empty() && !runs.is_empty());
    }
}

//! Places in a list of the model, as runs of neighbours.

use core::ops::Range;

/// Ascending places in one of the model's lists. Bodies are numbered depth first: all of a robot is
/// one run, and so is whatever one joint carries. A run is a slice, which a loop walks without
/// looking up where it stands.
#[derive(Clone, Debug, Default)]
pub(crate) struct Runs(Vec<Range<usize>>);

impl Runs {
    /// The places that are marked.
    pub(crate) fn marked(marks: &[bool]) -> Runs {
        (0..marks.len()).filter(|i| marks[*i]).collect()
    }

    /// Each run, ascending.
    #[inline(always)]
    pub(crate) fn runs(&self) -> impl DoubleEndedIterator<Item = Range<usize>> {
        self.0.iter().cloned()
    }

    /// Each place, ascending.
    pub(crate) fn places(&self) -> impl DoubleEndedIterator<Item = usize> {
        self.runs().flatten()
    }

    /// How many places there are.
    pub(crate) fn count(&self) -> usize {
        self.0.iter().map(Range::len).sum()
    }

    /// True where there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// True for one of the places.
    pub(crate) fn contains(&self, place: usize) -> bool {
        let after = self.0.partition_point(|run| run.start <= place);
        after > 0 && self.0[after - 1].contains(&place)
    }
}

/// From ascending places.
impl FromIterator<usize> for Runs {
    fn from_iter<I: IntoIterator<Item = usize>>(places: I) -> Runs {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for place in places {
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
        let places = [1, 2, 3, 7, 9, 10];
        let runs: Runs = places.into_iter().collect();
        assert_eq!(runs.runs().collect::<Vec<_>>(), [1..4, 7..8, 9..11]);
        assert_eq!(runs.places().collect::<Vec<_>>(), places);
        assert_eq!(runs.count(), places.len());
        let contained: Vec<usize> = (0..12).filter(|i| runs.contains(*i)).collect();
        assert_eq!(contained, places);
        assert!(Runs::marked(&[false; 3]).is_empty() && !runs.is_empty());
    }
}

//! Straight lines between the rows of a table over time.

/// The rows of increasing times around a time and the part of the way from the first to the second.
pub(super) fn place(times: &[f64], time: f64) -> (usize, usize, f64) {
    let after = times.partition_point(|of| *of <= time);
    match after {
        0 => (0, 0, 0.0),
        n if n == times.len() => (n - 1, n - 1, 0.0),
        n => (n - 1, n, (time - times[n - 1]) / (times[n] - times[n - 1])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_straight_between_its_rows_and_constant_beyond() {
        let times = [0.0, 1.0, 3.0];
        for (time, expected) in [
            (-1.0, (0, 0, 0.0)),
            (0.0, (0, 1, 0.0)),
            (0.25, (0, 1, 0.25)),
            (1.0, (1, 2, 0.0)),
            (2.0, (1, 2, 0.5)),
            (3.0, (2, 2, 0.0)),
            (9.0, (2, 2, 0.0)),
        ] {
            assert_eq!(place(&times, time), expected, "at {time}");
        }
        assert_eq!(place(&[2.0], 5.0), (0, 0, 0.0));
    }
}

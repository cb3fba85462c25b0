//! One axis: maps values to positions (themselves or their logarithms), and places its ticks.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use super::figure::{Axis, DRAWN_FOR_ZERO};

/// An axis with room for all its values.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    log: bool,
    /// The position of numbers without a logarithm.
    nothing: f64,
    /// The positions of both ends.
    from: f64,
    pub(super) to: f64,
    /// Positions and names, from small to large.
    ticks: Vec<(f64, String)>,
}

impl Scale {
    /// Over these values, with at most about `most` ticks; none without a finite value. Zero among
    /// `errors` is at 1e-17, or below the least other one.
    pub(super) fn new(axis: &Axis, errors: bool, values: &[f64], most: usize) -> Option<Scale> {
        let values = values.iter().filter(|x| x.is_finite());
        let mut finite: Vec<f64> = values.copied().collect();
        if finite.is_empty() {
            return None;
        }
        finite.extend(axis.shared.iter().filter(|x| x.is_finite()));
        let mut scale =
            Scale { log: axis.log, nothing: 0.0, from: 0.0, to: 0.0, ticks: Vec::new() };
        if axis.log {
            let least = finite.iter().copied().filter(|x| *x > 0.0).fold(f64::INFINITY, f64::min);
            // zero is one decade below the least other value
            let before = if least.is_finite() { least.log10().floor() - 1.0 } else { 0.0 };
            scale.nothing = if errors { before.min(DRAWN_FOR_ZERO.log10()) } else { before };
        }
        let places = || finite.iter().map(|x| scale.place(*x));
        let (from, to) =
            (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max));
        let margin = if to > from { 0.04 * (to - from) } else { 0.5 };
        (scale.from, scale.to) = (from - margin, to + margin);
        scale.ticks = if axis.log { scale.powers(most) } else { scale.steps(most) };
        if axis.log && finite.iter().any(|x| *x <= 0.0) {
            scale.ticks.retain(|(place, _)| *place > scale.nothing + 0.5);
            scale.ticks.insert(0, (scale.nothing, "0".to_owned()));
        }
        Some(scale)
    }

    /// The position of a value.
    pub(super) fn place(&self, value: f64) -> f64 {
        match self.log {
            false => value,
            true if value > 0.0 => value.log10(),
            true => self.nothing,
        }
    }

    /// Powers of ten, every second or third of them where they are many; 1, 2 and 5 where they are
    /// few.
    fn powers(&self, most: usize) -> Vec<(f64, String)> {
        let range = || (self.from.ceil() as i32)..=(self.to.floor() as i32);
        let mut step = 1;
        while range().count() > most * step as usize {
            step += 1;
        }
        let mut ticks: Vec<(f64, String)> = range()
            .filter(|k| k.rem_euclid(step) == 0)
            .map(|k| (f64::from(k), power(1, k)))
            .collect();
        if ticks.len() < 3 {
            let parts = |k: i32| {
                [1, 2, 5].map(|part| (f64::from(part).log10() + f64::from(k), power(part, k)))
            };
            let finer = (self.from.floor() as i32..=self.to.floor() as i32).flat_map(parts);
            let finer: Vec<_> =
                finer.filter(|(place, _)| (self.from..=self.to).contains(place)).collect();
            if finer.len() > ticks.len() && finer.len() <= most {
                ticks = finer;
            }
        }
        ticks
    }

    /// Multiples of 1, 2 or 5 times a power of ten.
    fn steps(&self, most: usize) -> Vec<(f64, String)> {
        let least = (self.to - self.from) / most as f64;
        let power = least.log10().floor();
        let step = [1.0, 2.0, 5.0, 10.0]
            .map(|part| part * 10f64.powf(power))
            .into_iter()
            .find(|step| *step >= least)
            .unwrap_or(least);
        let digits = (-step.log10().floor()).max(0.0) as usize;
        let name = |x: f64| {
            if digits > 4 || x.abs() >= 1e6 { format!("{x:.0e}") } else { format!("{x:.digits$}") }
        };
        let first = (self.from / step).ceil() as i64;
        (first..)
            .map(|k| k as f64 * step)
            .take_while(|x| *x <= self.to)
            .map(|x| (x, name(x)))
            .collect()
    }
}

/// For the drawing library, which uses positions only.
impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, (first, last): (i32, i32)) -> i32 {
        let share = (place - self.from) / (self.to - self.from);
        first + (share * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.iter().map(|(place, _)| *place).collect()
    }

    fn range(&self) -> Range<f64> {
        self.from..self.to
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, place: &f64) -> String {
        self.ticks
            .iter()
            .find(|(tick, _)| tick == place)
            .map(|(_, name)| name.clone())
            .unwrap_or_default()
    }
}

/// `part` times ten to the `k`, in common notation.
fn power(part: i32, k: i32) -> String {
    match k {
        0..=4 => (part * 10_i32.pow(k as u32)).to_string(),
        -2..0 => format!("{:.*}", -k as usize, f64::from(part) * 10f64.powi(k)),
        _ => {
            const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
            let raise =
                |sign: char| sign.to_digit(10).map_or('⁻', |digit| RAISED[digit as usize]);
            let raised: String = k.to_string().chars().map(raise).collect();
            if part == 1 { format!("10{raised}") } else { format!("{part}·10{raised}") }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that fails panics")]
mod tests {
    use super::*;

    fn names(scale: &Scale) -> Vec<&str> {
        scale.ticks.iter().map(|(_, name)| name.as_str()).collect()
    }

    #[test]
    fn ticks_of_a_logarithm_are_powers_of_ten() {
        let axis = Axis { log: true, ..Axis::default() };
        let scale = Scale::new(&axis, false, &[90.0, 2e5], 8).unwrap();
        assert_eq!(names(&scale), ["100", "1000", "10000", "10⁵"]);
        let scale = Scale::new(&axis, true, &[1e-16, 1.0], 6).unwrap();
        assert_eq!(names(&scale), ["10⁻¹⁵", "10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³", "1"]);
        let scale = Scale::new(&axis, false, &[90.0, 600.0], 8).unwrap();
        assert_eq!(names(&scale), ["100", "200", "500"]);
    }

    #[test]
    fn zero_has_a_place_on_a_logarithm() {
        let axis = Axis { log: true, ..Axis::default() };
        let scale = Scale::new(&axis, false, &[0.0, 1.0, 100.0], 8).unwrap();
        assert_eq!(names(&scale), ["0", "1", "10", "100"]);
        assert_eq!(scale.place(0.0), -1.0);
        let scale = Scale::new(&axis, true, &[0.0, 1e-3], 8).unwrap();
        assert!((scale.place(0.0) + 17.0).abs() < 1e-12);
        assert_eq!(names(&scale)[0], "0");
        let scale = Scale::new(&axis, true, &[0.0, 2e-28, 1e-3], 8).unwrap();
        assert_eq!(scale.place(0.0), -29.0);
    }

    #[test]
    fn ticks_of_a_linear_axis_are_round() {
        let scale = Scale::new(&Axis::default(), false, &[0.0, 0.03], 6).unwrap();
        assert_eq!(names(&scale), ["0.00", "0.01", "0.02", "0.03"]);
        assert!(Scale::new(&Axis::default(), false, &[f64::NAN], 6).is_none());
        assert!(!names(&Scale::new(&Axis::default(), false, &[7.0], 6).unwrap()).is_empty());
    }
}

//! Random inputs of a plan.

use sarrus_dynamics::{Field, Layout, ModelInfo};

/// Part of the range of each coordinate, in turns: far out closures may be out of reach.
const PARTS: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// Input number `k` of a fixed sequence: coordinates in their limits, rates of up to 1 and 5,
/// forces of up to 10, in SI.
pub fn random_input(info: &ModelInfo, given: &Layout, k: u64) -> Vec<f64> {
    let mut random = fastrand::Rng::with_seed(k.wrapping_add(20_261_122));
    let part = PARTS[(k % 4) as usize];
    let mut input = vec![0.0; given.len()];
    for slot in given.slots() {
        for (row, x) in input[slot.range()].iter_mut().enumerate() {
            let unit = 2.0 * random.f64() - 1.0;
            *x = match slot.field {
                Field::Y => {
                    let (lower, upper) = range(info, row);
                    // a part of the range around what is nearest to zero in it
                    let middle = 0.0_f64.clamp(lower, upper);
                    let far = if unit < 0.0 { lower } else { upper };
                    middle + (far - middle) * part * unit.abs()
                }
                Field::Yd => unit,
                Field::Ydd => 5.0 * unit,
                _ => 10.0 * unit,
            };
        }
    }
    input
}

/// Range of an independent coordinate, at most half a turn or a metre to each side.
fn range(info: &ModelInfo, row: usize) -> (f64, f64) {
    let limits = info.independent_q.get(row).and_then(|name| {
        let v = info.tree.iter().position(|joint| joint == name)?;
        *info.limits.get(v)?
    });
    let lower = limits.and_then(|limits| limits.lower).unwrap_or(-3.0).max(-3.0);
    let upper = limits.and_then(|limits| limits.upper).unwrap_or(3.0).min(3.0);
    (lower.min(upper), upper)
}

//! A loaded kernel against the generic ones, bit by bit.

use sarrus_dynamics::{Model, Plan, Workspace};

use super::NativeKernel;
use crate::RandomInputs;

/// States that are compared.
pub(super) const STATES: u64 = 4096;
/// First of the states; no tracer has seen it.
const FRESH: u64 = 9_000_000;

/// How many states the kernel answered, all as the plan does; or the first that it answered
/// otherwise, and how.
pub(super) fn compare(
    kernel: &NativeKernel,
    model: &Model<f64>,
    plan: &Plan,
) -> Result<u64, (u64, String)> {
    let mut workspace = Workspace::for_plans(model, [plan]);
    let [mut expected, mut output] = [(); 2].map(|()| vec![0.0; plan.want().len()]);
    let mut inputs = RandomInputs::new(model, plan);
    let mut answered = 0;
    for k in 0..STATES {
        let mut input = inputs.input(FRESH + k);
        disturb(&mut input, k);
        let answer = kernel.answer((model, plan), &mut workspace, &input, &mut output);
        let Some(answer) = answer else { continue };
        let right = plan.run(model, &mut workspace, &input, &mut expected);
        if answer != right {
            let [found, expected] = [answer, right]
                .map(|answer| format!("{} {:?}", answer.status.name(), answer.warnings));
            return Err((k, format!("{found}, expected {expected}")));
        }
        let pairs = output.iter().zip(&expected);
        if let Some((found, expected)) = pairs.clone().find(|(a, b)| a.to_bits() != b.to_bits()) {
            return Err((k, format!("{found:?}, expected {expected:?}")));
        }
        answered += 1;
    }
    Ok(answered)
}

/// One state in eight is at rest, has zeros of both signs, is far out, or holds what is no number.
fn disturb(input: &mut [f64], k: u64) {
    let (n, place) = (input.len(), k as usize / 64);
    if n == 0 {
        return;
    }
    match k % 64 {
        0 => input.iter_mut().skip(n / 3).for_each(|x| *x = 0.0),
        8 => input.iter_mut().for_each(|x| *x = if *x > 0.0 { 0.0 } else { -0.0 }),
        16 => input.iter_mut().skip(place % n).take(1).for_each(|x| *x = f64::NAN),
        24 => input.iter_mut().skip(place % n).take(1).for_each(|x| *x = f64::INFINITY),
        32 => input.iter_mut().for_each(|x| *x *= 1e3),
        40 => input.iter_mut().skip(n / 3).for_each(|x| *x *= 1e170),
        48 => input.iter_mut().step_by(3).for_each(|x| *x = 0.0),
        56 => input.iter_mut().for_each(|x| *x *= 1e-300),
        _ => {}
    }
}

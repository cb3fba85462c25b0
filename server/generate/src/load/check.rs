//! A loaded kernel against the generic ones, bit by bit.

use sarrus_dynamics::{Answer, Model, Plan, Workspace};

use super::NativeKernel;
use crate::RandomInputs;

/// States that are compared.
pub(super) const STATES: u64 = 4096;
/// First of the states; no tracer has seen it.
const FRESH: u64 = 9_000_000;

/// Counts of a kernel's answers, all equal to the plan's.
pub(super) struct Compared {
    /// How many states.
    pub(super) answered: u64,
    /// Number of rows that the function for rows left to the plan, as its combined checks allow.
    left: u64,
}

impl Compared {
    /// Whether the function for rows is worth its calls.
    pub(super) fn has_rows(&self) -> bool {
        self.left * 8 <= self.answered
    }
}

/// The counts of the kernel's answers; or the first state with another answer, and the difference.
pub(super) fn compare(
    kernel: &NativeKernel,
    model: &Model<f64>,
    plan: &Plan,
) -> Result<Compared, (u64, String)> {
    let mut workspace = Workspace::for_plans(model, [plan]);
    let [mut expected, mut output] = [(); 2].map(|()| vec![0.0; plan.want().len()]);
    let mut inputs = RandomInputs::new(model, plan);
    let mut group = Group::default();
    let mut answered = 0;
    let mut left = 0;
    for k in 0..STATES {
        let mut input = inputs.input(FRESH + k);
        disturb(&mut input, k);
        let closed = match plan.closes_apart() {
            true => plan.close(model, &mut workspace, &input).map(<[f64]>::to_vec),
            false => Some(input.clone()),
        };
        let Some(closed) = closed else { continue };
        let answer = kernel.answer((model, plan), &mut workspace, &input, &mut output);
        group.push(&closed, answer, &output);
        left += group.compare(kernel).map_err(|what| (k, what))?;
        let Some(answer) = answer else { continue };
        let right = plan.run(model, &mut workspace, &input, &mut expected);
        same((answer, &output), (right, &expected)).map_err(|what| (k, what))?;
        answered += 1;
    }
    Ok(Compared { answered, left })
}

/// The difference between two answers.
fn same(
    (answer, output): (Answer, &[f64]),
    (right, expected): (Answer, &[f64]),
) -> Result<(), String> {
    if answer != right {
        let [found, expected] =
            [answer, right].map(|answer| format!("{} {:?}", answer.status.name(), answer.warnings));
        return Err(format!("{found}, expected {expected}"));
    }
    let mut pairs = output.iter().zip(expected);
    match pairs.find(|(a, b)| a.to_bits() != b.to_bits()) {
        Some((found, expected)) => Err(format!("{found:?}, expected {expected:?}")),
        None => Ok(()),
    }
}

/// States for the function for rows, with the answers of that for one.
#[derive(Default)]
struct Group {
    input: Vec<f64>,
    answers: Vec<Option<Answer>>,
    output: Vec<f64>,
}

impl Group {
    fn push(&mut self, closed: &[f64], answer: Option<Answer>, output: &[f64]) {
        self.input.extend(closed);
        self.answers.push(answer);
        self.output.extend(output);
    }

    /// Once there are enough states, the function for rows must answer as the function for one
    /// does, or leave the row because of its combined checks; returns the number of rows left.
    fn compare(&mut self, kernel: &NativeKernel) -> Result<u64, String> {
        let rows = kernel.rows();
        if rows == 1 || self.answers.len() < rows {
            return Ok(0);
        }
        let mut left = 0;
        let mut output = vec![0.0; self.output.len()];
        let bits = kernel.bits(&self.input, &mut output, 0);
        let width = output.len() / rows;
        for (row, expected) in self.answers.iter().enumerate() {
            let answer = bits.as_ref().and_then(|bits| bits.answer(row));
            let [found, right] = [&output, &self.output].map(|rows| &rows[row * width..][..width]);
            match (answer, *expected) {
                (Some(answer), Some(expected)) => same((answer, found), (expected, right))
                    .map_err(|what| format!("row: {what}"))?,
                (None, expected) => left += u64::from(expected.is_some()),
                (Some(_), None) => return Err("a row is answered that alone is left".to_owned()),
            }
        }
        *self = Group::default();
        Ok(left)
    }
}

/// One state in eight is at rest, has zeros of both signs, is far out, or holds NaN or an infinity.
fn disturb(input: &mut [f64], k: u64) {
    let n = input.len();
    let place = k as usize / 64;
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

//! Kernels are loaded here, and compared with the generic ones bit by bit before they are used.

use std::path::Path;

use sarrus_dynamics::{Answer, Model, Plan, Workspace};

use super::object::Object;
use super::{LoadError, LoadFault, Loaded, NativeKernel, ObjectFile};
use crate::RandomInputs;
use crate::manifest::bare_query;

/// First of the states; no tracer has seen it.
const FRESH: u64 = 9_000_000;

impl NativeKernel {
    /// How many states a kernel is compared with its plan on before it is used.
    pub const STATES: u64 = 4096;

    /// Reads, checks and loads the shared object of a plan on the model that it was made for, and
    /// compares its answers with the plan's on thousands of states, in a thread of its own: changes
    /// of the floating-point environment at loading end with that thread. Allocates.
    ///
    /// # Errors
    /// [`LoadError`] with the reason; nothing of it stays loaded.
    pub fn open(path: &Path, model: &Model<f64>, plan: &Plan) -> Result<NativeKernel, LoadError> {
        NativeKernel::load(&ObjectFile::read(path)?, model, plan)
    }

    /// As [`NativeKernel::open`], for the plan that the file itself names. Allocates.
    ///
    /// # Errors
    /// As [`NativeKernel::open`].
    pub fn of_file(path: &Path, model: &Model<f64>) -> Result<NativeKernel, LoadError> {
        let file = ObjectFile::read(path)?;
        let plan = file.plan(model)?;
        NativeKernel::load(&file, model, &plan)
    }

    /// As [`NativeKernel::open`], of a file that was read.
    ///
    /// # Errors
    /// As [`NativeKernel::open`].
    pub fn load(file: &ObjectFile, model: &Model<f64>, plan: &Plan) -> Loaded<NativeKernel> {
        let manifest = file.manifest();
        file.plan(model)?;
        let sizes = [plan.given().len() + plan.closed_len(), plan.want().len()];
        if manifest.query != bare_query(plan.query())
            || [manifest.inputs, manifest.outputs] != sizes
        {
            return Err(LoadFault::WrongQuery.of(file.path()));
        }
        let missing = manifest.missing_instructions();
        if !missing.is_empty() {
            return Err(LoadFault::Processor(missing.join(" and ")).of(file.path()));
        }
        let load = || NativeKernel::loaded(file, model, plan);
        std::thread::scope(|scope| {
            // functions of many numbers have large frames
            let builder = std::thread::Builder::new().stack_size(16 << 20);
            let loader = builder.spawn_scoped(scope, load);
            let loader = loader.map_err(|error| LoadFault::Io(error).of(file.path()))?;
            loader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }

    /// Loads and compares, on a thread whose floating-point mode may be lost.
    fn loaded(file: &ObjectFile, model: &Model<f64>, plan: &Plan) -> Loaded<NativeKernel> {
        let manifest = file.manifest().clone();
        let states = NativeKernel::STATES;
        let mut kernel = NativeKernel { object: Object::load(file)?, manifest };
        let differs = |(state, what)| LoadFault::Differs { state, states, what }.of(file.path());
        let [answered, left] = compare(&kernel, model, plan).map_err(differs)?;
        if answered == 0 {
            return Err(LoadFault::Unserved(states).of(file.path()));
        }
        // otherwise the function for rows is not worth its calls
        if left * 8 > answered {
            kernel.object.leave_rows();
        }
        Ok(kernel)
    }
}

/// How many states the kernel answers, all as the plan does, and how many of those the function for
/// rows leaves to the plan, as its combined checks allow; or the first state with another answer,
/// and the difference.
fn compare(
    kernel: &NativeKernel,
    model: &Model<f64>,
    plan: &Plan,
) -> Result<[u64; 2], (u64, String)> {
    let mut workspace = Workspace::for_plans(model, [plan]);
    let [mut expected, mut output] = [(); 2].map(|()| vec![0.0; plan.want().len()]);
    let mut inputs = RandomInputs::new(model, plan);
    let mut group = Group::default();
    let mut answered = 0;
    let mut left = 0;
    for k in 0..NativeKernel::STATES {
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
    Ok([answered, left])
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

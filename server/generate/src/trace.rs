//! From a plan to its straight-line code.

use sarrus_dynamics::scalar::{DOUBTFUL, Real};
use sarrus_dynamics::{
    Method, Model, Plan, QueryOptions, Request, STRAIGHT_FIELDS, STRAIGHT_GIVEN, Status, Warnings,
    Workspace,
};

use crate::graph::{Check, Comparison};
use crate::lengths::Lengths;
use crate::recorder::{self, Obstacle, Record, Traced};
use crate::{GenerateError, Generated, Kernel, Outcome, RandomInputs, prune};

/// Most operations that are recorded, and that are left for a compiler.
const RECORDED: usize = 400_000;
const COMPILED: usize = 40_000;
/// States that are looked at for one without warnings, branches that are traced, states that decide
/// between them, and states on which the code is compared with the kernel.
const TRIED: u64 = 400;
const TRACED: usize = 8;
const COMPARED: u64 = 256;
/// States in the test.
const GOLDEN: usize = 32;
/// Below the bound on doubt by more than the rounding of the compared number.
const SURE: f64 = DOUBTFUL * (1.0 - 1e-9);

impl Kernel {
    /// Traces a plan on the model that it was made for, where most random states go, and compares
    /// the result with the plan's answers on others. Allocates.
    pub fn trace(model: &Model<f64>, plan: &Plan) -> Generated<Kernel> {
        Kernel::traced(model, plan, &Lengths::default(), true)
    }

    /// As [`Kernel::trace`] for a display: zeros may have the other sign than the plan's, and
    /// answers may have the warning `ill_conditioned`, which the code does not give. More states
    /// are answered, as at rest and at symmetric poses.
    pub fn trace_for_display(model: &Model<f64>, plan: &Plan) -> Generated<Kernel> {
        Kernel::traced(model, plan, &Lengths::default(), false)
    }

    /// As [`Kernel::trace_for_display`], with lengths of the robot as inputs behind all others.
    ///
    /// # Errors
    /// Besides, [`GenerateError::Lengths`]: a constant of the code, as of a closed form, does not
    /// move along a straight line.
    pub fn trace_with_lengths(
        model: &Model<f64>,
        plan: &Plan,
        lengths: &Lengths,
    ) -> Generated<Kernel> {
        Kernel::traced(model, plan, lengths, false)
    }

    /// The branch that a plan takes at one given input, for states that the branch of most random
    /// ones does not serve; for a display too.
    pub fn trace_at(model: &Model<f64>, plan: &Plan, input: &[f64]) -> Generated<Kernel> {
        check_fields(plan)?;
        let lengths = &Lengths::default();
        let mut generic = Generic::new(model, plan, lengths);
        let (last, _) = generic.answer(input);
        match generic.closed(input) {
            Some(closed) if last == Status::Ok => {
                let states = std::slice::from_ref(&closed);
                let kernel = at_state(model, plan, lengths, &closed, states, false)?;
                generic.compare(&kernel, input, false)?;
                Ok(kernel)
            }
            _ => Err(GenerateError::NoState { tried: 1, last }),
        }
    }

    fn traced(
        model: &Model<f64>,
        plan: &Plan,
        lengths: &Lengths,
        is_strict: bool,
    ) -> Generated<Kernel> {
        check_fields(plan)?;
        let mut generic = Generic::new(model, plan, lengths);
        let mut states = Vec::new();
        let mut last = Status::Ok;
        for k in 0..TRIED {
            let input = generic.inputs.input(k);
            let (status, warnings) = generic.answer(&input);
            last = status;
            if status == Status::Ok && warnings == Warnings::NONE {
                states.extend(generic.closed(&input));
            }
        }
        // the traced branch that serves most of them
        let mut best: Option<(usize, Kernel)> = None;
        let mut refused = None;
        for state in states.iter().take(TRACED) {
            let kernel = match at_state(model, plan, lengths, state, &states, is_strict) {
                Ok(kernel) => kernel,
                Err(error) => {
                    refused.get_or_insert(error);
                    continue;
                }
            };
            let served = states.iter().filter(|state| is_served(&kernel, state)).count();
            if best.as_ref().is_none_or(|(most, _)| *most < served) {
                best = Some((served, kernel));
            }
            if served == states.len() {
                break;
            }
        }
        let kernel = match (best, refused) {
            (Some((1.., kernel)), _) => kernel,
            (Some(_), _) => return Err(GenerateError::Unserved(states.len())),
            (None, Some(error)) => return Err(error),
            (None, None) => return Err(GenerateError::NoState { tried: TRIED as usize, last }),
        };
        for k in 0..COMPARED {
            let input = generic.inputs.input(TRIED + k);
            generic.compare(&kernel, &input, is_strict)?;
        }
        Ok(kernel)
    }
}

fn is_served(kernel: &Kernel, state: &[f64]) -> bool {
    let mut output = vec![0.0; kernel.outputs()];
    kernel.evaluate(state, &mut output) != Outcome::NotAnswered
}

/// Only fields whose computation is a straight line.
fn check_fields(plan: &Plan) -> Generated {
    let query = plan.query();
    let other = query.given.iter().find(|field| !STRAIGHT_GIVEN.has(*field));
    let other = other.or(query.want.iter().find(|field| !STRAIGHT_FIELDS.has(*field)));
    if let Some(field) = other {
        return Err(GenerateError::Field(field));
    }
    let has_friction = query.options.contains(QueryOptions::FRICTION);
    let is_kkt = query.request == Request::ForwardDynamics as u32 && plan.method() == Method::Kkt;
    if has_friction || is_kkt {
        return Err(GenerateError::NotStraight);
    }
    Ok(())
}

/// The code of the branch that the kernels take at one state.
fn at_state(
    model: &Model<f64>,
    plan: &Plan,
    lengths: &Lengths,
    state: &[f64],
    states: &[Vec<f64>],
    is_strict: bool,
) -> Generated<Kernel> {
    let run = |model: &Model<Traced>, workspace: &mut Workspace<Traced>, given: &[Traced]| {
        let mut output = vec![Traced::ZERO; plan.want().len()];
        let answer = plan.run_closed(model, workspace, given, &mut output);
        if is_strict {
            record_doubt();
        }
        (answer.status == Status::Ok).then_some(output)
    };
    let state = &state[..state.len() - lengths.values.len()];
    let kernel = recorded(model, plan, lengths, state, is_strict, run)?;
    Ok(Kernel { golden: states.iter().take(GOLDEN).cloned().collect(), ..kernel })
}

/// The code of a function of kernels at one input, behind which the lengths are inputs too; the
/// function returns nothing where it fails. Outputs may be zeros of the other sign unless
/// `is_strict`.
pub(crate) fn recorded(
    model: &Model<f64>,
    plan: &Plan,
    lengths: &Lengths,
    input: &[f64],
    is_strict: bool,
    run: impl FnOnce(&Model<Traced>, &mut Workspace<Traced>, &[Traced]) -> Option<Vec<Traced>>,
) -> Generated<Kernel> {
    recorder::start(RECORDED);
    let traced = lengths.traced(model, input.len());
    let mut workspace = Workspace::for_plans(&traced, [plan]);
    let given: Vec<Traced> = input.iter().enumerate().map(|(k, x)| Traced::input(k, *x)).collect();
    let output = run(&traced, &mut workspace, &given);
    let record = recorder::take();
    let output = match (record.obstacle, output) {
        (None, Some(output)) => output,
        (Some(Obstacle::TooLarge), _) => return Err(GenerateError::TooLarge(RECORDED)),
        _ => return Err(GenerateError::NotStraight),
    };
    let Record { operations, decisions, mut checks, dropped, limited, .. } = record;
    let is_known = |comparison: Comparison| {
        let (Comparison::Less(a, b) | Comparison::Equal(a, b)) = comparison;
        a.value().is_some() && b.value().is_some()
    };
    let branches = decisions.iter().filter(|x| !x.is_choice && !is_known(x.comparison));
    checks.extend(branches.map(|x| Check::Branch(x.comparison, x.outcome)));
    let loose = output.iter().filter(|x| x.loose && is_strict);
    checks.extend(loose.map(|x| Check::NotZero(x.term)));
    let kernel = Kernel {
        info: model.info().clone(),
        plan: plan.clone(),
        operations,
        outputs: output.iter().map(|x| x.term).collect(),
        checks,
        limited,
        lengths: lengths.clone(),
        golden: Vec::new(),
    };
    let kernel = prune::pruned(kernel, &dropped);
    Lengths::check(&kernel.operations)?;
    if kernel.operations.len() > COMPILED {
        return Err(GenerateError::TooLarge(COMPILED));
    }
    Ok(kernel)
}

/// Records the condition under which a plan does not count digits, see
/// [`sarrus_dynamics::scalar::BranchValue`].
fn record_doubt() {
    let (gains, growths) = recorder::with(|record| (record.gains.clone(), record.growths.clone()));
    let larger = |a: Traced, b: Traced| Traced::select(a.lt(b), b, a);
    // the larger of two does not reveal NaN
    for x in gains.iter().chain(&growths) {
        recorder::check(Check::Finite(x.term));
    }
    let gain = gains.into_iter().fold(Traced::ONE, larger);
    let growth =
        growths.into_iter().fold(gain * gain.sqrt(), |product, x| product * larger(Traced::ONE, x));
    let bound = Comparison::Less(growth.term, Traced::constant(SURE).term);
    recorder::check(Check::Branch(bound, true));
}

/// The generic kernel.
struct Generic<'a> {
    model: &'a Model<f64>,
    plan: &'a Plan,
    lengths: &'a Lengths,
    inputs: RandomInputs<'a>,
    workspace: Workspace<f64>,
    output: Vec<f64>,
}

impl<'a> Generic<'a> {
    fn new(model: &'a Model<f64>, plan: &'a Plan, lengths: &'a Lengths) -> Generic<'a> {
        let workspace = Workspace::for_plans(model, [plan]);
        let inputs = RandomInputs::new(model, plan);
        Generic { model, plan, lengths, inputs, workspace, output: vec![0.0; plan.want().len()] }
    }

    /// The input of the code: with the results of closures by Newton's method, and lengths.
    fn closed(&mut self, input: &[f64]) -> Option<Vec<f64>> {
        let closed = self.plan.close(self.model, &mut self.workspace, input);
        closed.map(|closed| [closed, &self.lengths.values].concat())
    }

    fn answer(&mut self, input: &[f64]) -> (Status, Warnings) {
        let answer = self.plan.run(self.model, &mut self.workspace, input, &mut self.output);
        (answer.status, answer.warnings)
    }

    /// Where the code answers it has the kernel's bits.
    fn compare(&mut self, kernel: &Kernel, input: &[f64], is_strict: bool) -> Generated {
        let Some(closed) = self.closed(input) else { return Ok(()) };
        let (status, warnings) = self.answer(input);
        let mut output = vec![0.0; self.output.len()];
        let expected = match kernel.evaluate(&closed, &mut output) {
            Outcome::NotAnswered => return Ok(()),
            Outcome::Ok => Warnings::NONE,
            Outcome::LimitsExceeded => Warnings::LIMITS_EXCEEDED,
        };
        let warnings = match is_strict {
            true => warnings,
            false => Warnings(warnings.0 & !Warnings::ILL_CONDITIONED.0),
        };
        let is_same = |(a, b): (&f64, &f64)| match is_strict {
            true => a.to_bits() == b.to_bits(),
            false => a == b,
        };
        let same = output.iter().zip(&self.output).all(is_same);
        if status == Status::Ok && warnings == expected && same {
            Ok(())
        } else {
            Err(GenerateError::Differs(input.to_vec()))
        }
    }
}

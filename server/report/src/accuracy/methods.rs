//! Every measured method of a robot: closures with their tolerances, and methods of forward
//! dynamics.

use sarrus_dynamics::{Method as Forward, Model, Plan};

use super::runner::{Differences, Implicit, Runner, with_start};
use crate::Outcome;
use crate::robots::{Planned, Question, Robot, Start, Subject, Variant};

/// Tolerances of the last Newton step, for the state alone and for dynamics.
const TOLERANCES: [f64; 13] =
    [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15];
const FEW_TOLERANCES: [f64; 5] = [1e-3, 1e-6, 1e-9, 1e-12, 1e-15];
/// Bounds on the Newton steps, from a nearby closed pose and from the zero pose.
const STEPS: [u32; 5] = [1, 2, 3, 4, 6];
const STEPS_FROM_ZERO: [u32; 6] = [1, 2, 3, 4, 6, 8];
/// Steps of central differences `[rad, m, 1/s, N, N m]`.
const DIFFERENCES: [f64; 5] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7];
/// Tree velocities up to which dense systems are measured.
const LARGEST_SQUARE: usize = 100;

/// A method with one setting, and its time and error once they are measured.
pub(super) struct Method {
    pub(super) question: Question,
    /// Its name in the legend and its setting.
    pub(super) series: String,
    pub(super) label: String,
    /// The defaults.
    pub(super) default: bool,
    /// The variant of the robot, and the start of Newton's method.
    pub(super) place: usize,
    pub(super) start: Start,
    pub(super) runner: Box<dyn Runner>,
    /// Median of a call.
    pub(super) ns: f64,
    /// The worst of all states; NaN if some state has no answer.
    pub(super) error: f64,
    /// The largest |φ| of q, if q is wanted.
    pub(super) residual: Option<f64>,
    /// The reason why there is no answer.
    pub(super) fault: Option<String>,
}

/// A way to close loops: the variant, its name, and the start of Newton's method.
#[derive(Clone, Copy)]
struct Closing<'a> {
    place: usize,
    variant: &'a Variant,
    name: &'static str,
    start: Start,
    default: bool,
}

impl Closing<'_> {
    fn model(&self) -> &Model {
        &self.variant.compiled.model
    }

    /// True if dense systems are measured.
    fn is_small(&self) -> bool {
        self.model().sizes().n_v <= LARGEST_SQUARE
    }
}

/// The end of Newton's method.
#[derive(Clone, Copy)]
enum End {
    /// The model's own, with the label of the setting.
    Usual(&'static str),
    /// At this tolerance.
    Tolerance(f64),
    /// After this many steps at most, at any misfit.
    Steps(u32),
    /// The model's own, for differences of this step.
    Step(f64),
}

impl End {
    fn model(self, model: &Model) -> Model {
        match self {
            End::Usual(_) | End::Step(_) => model.clone(),
            End::Tolerance(tolerance) => model.with_tolerance(tolerance, 10),
            End::Steps(steps) => model.with_tolerance(0.0, steps),
        }
    }

    fn label(self) -> String {
        match self {
            End::Usual(label) => label.to_owned(),
            End::Tolerance(tolerance) => format!("tolerance {tolerance:.0e}"),
            End::Steps(1) => "one step".to_owned(),
            End::Steps(steps) => format!("at most {steps} steps"),
            End::Step(step) => format!("step {step:.0e}"),
        }
    }

    fn series(self) -> &'static str {
        if matches!(self, End::Steps(_)) { "double, bounded steps" } else { "double" }
    }
}

/// The methods collected so far.
struct Methods<'a> {
    robot: &'a Robot,
    all: Vec<Method>,
}

/// All of a robot.
pub(super) fn of_robot(robot: &Robot) -> Outcome<Vec<Method>> {
    let mut methods = Methods { robot, all: Vec::new() };
    let given = robot.variants.first().ok_or("no variant")?.closures;
    let numerical = robot.variants.iter().position(|variant| variant.closures == "numerical");
    let chain = matches!(robot.subject, Subject::Chain(_));
    let closing = |place, name, start, default| {
        let variant = &robot.variants[place];
        Closing { place, variant, name, start, default }
    };
    if chain || given == "analytic" {
        methods.given(closing(0, "closed form", Start::None, true))?;
    } else if given != "numerical" {
        methods.given(closing(0, "as given", Start::Warm, true))?;
    }
    if let Some(place) = numerical {
        methods.newton(closing(place, "Newton, warm", Start::Warm, place == 0))?;
        methods.cold(closing(place, "Newton, cold", Start::Cold, false))?;
    }
    Ok(methods.all)
}

impl Methods<'_> {
    /// Loops closed by the robot's own types.
    fn given(&mut self, closing: Closing<'_>) -> Outcome {
        let end = End::Usual("usual");
        self.everything(&closing, end)?;
        self.derivatives(&closing, end)?;
        if closing.is_small() { self.implicit(&closing, end) } else { Ok(()) }
    }

    /// Newton's method from a nearby closed pose, with varied tolerances and steps.
    fn newton(&mut self, closing: Closing<'_>) -> Outcome {
        let forward = Question::Forced(closing.model().forward_method());
        for tolerance in TOLERANCES {
            let end = End::Tolerance(tolerance);
            self.ask(&closing, Question::State, end)?;
            if FEW_TOLERANCES.contains(&tolerance) {
                self.ask(&closing, Question::InverseDynamics, end)?;
                self.ask(&closing, forward, end)?;
                if closing.is_small() {
                    self.implicit(&closing, end)?;
                }
            }
        }
        self.everything(&closing, End::Usual("usual end"))?;
        if closing.default {
            self.derivatives(&closing, End::Usual("usual end"))?;
        }
        for steps in STEPS {
            self.ask(&closing, Question::State, End::Steps(steps))?;
            if steps <= 3 {
                self.ask(&closing, Question::InverseDynamics, End::Steps(steps))?;
            }
        }
        Ok(())
    }

    /// Newton's method without a guess, with varied tolerances and steps.
    fn cold(&mut self, closing: Closing<'_>) -> Outcome {
        for tolerance in FEW_TOLERANCES {
            self.ask(&closing, Question::State, End::Tolerance(tolerance))?;
        }
        self.ask(&closing, Question::State, End::Usual("usual end"))?;
        for steps in STEPS_FROM_ZERO {
            self.ask(&closing, Question::State, End::Steps(steps))?;
        }
        Ok(())
    }

    /// Every question, with forward dynamics by every applicable method.
    fn everything(&mut self, closing: &Closing<'_>, end: End) -> Outcome {
        self.ask(closing, Question::State, end)?;
        self.ask(closing, Question::InverseDynamics, end)?;
        for method in Forward::ALL {
            if closing.is_small() || method != Forward::Kkt {
                self.ask(closing, Question::Forced(method), end)?;
            }
        }
        Ok(())
    }

    /// A default closes loops with the default tolerance and uses the model's own forward dynamics.
    fn ask(&mut self, closing: &Closing<'_>, question: Question, end: End) -> Outcome {
        let model = end.model(closing.model());
        let query = with_start(question.query(), closing.start);
        let mut series = format!("{}, {}", closing.name, end.series());
        let mut default = closing.default && matches!(end, End::Usual(_));
        let plan = if let Question::Forced(method) = question {
            series = format!("{}, {series}", method.name());
            default &= method == model.forward_method();
            Plan::with_method(&model, &query, method)?
        } else {
            Plan::new(&model, &query)?
        };
        let runner = Box::new(Planned::new(&model, plan, &self.robot.states, closing.place));
        let question = if question.is_forward() { Question::ForwardDynamics } else { question };
        self.add(closing, question, (series, end, default), runner);
        Ok(())
    }

    /// Derivatives by the plan and by differences, of robots without quaternions in y.
    fn derivatives(&mut self, closing: &Closing<'_>, end: End) -> Outcome {
        let Closing { place, start, name, .. } = *closing;
        let sizes = closing.model().sizes();
        for question in Question::DERIVATIVES.into_iter().filter(|_| closing.is_small()) {
            self.ask(closing, question, end)?;
            for step in DIFFERENCES.into_iter().filter(|_| sizes.n_qy == sizes.n_vy) {
                let asked = (question, start);
                let of = Differences::new(closing.model(), self.robot, place, asked, step)?;
                let series = format!("central differences, {name}, double");
                self.add(closing, question, (series, End::Step(step), false), Box::new(of));
            }
        }
        Ok(())
    }

    fn implicit(&mut self, closing: &Closing<'_>, end: End) -> Outcome {
        let model = end.model(closing.model());
        let runner = Box::new(Implicit::new(&model, self.robot, closing.place, closing.start)?);
        let series = format!("implicit form with Baumgarte, {}, double", closing.name);
        self.add(closing, Question::ForwardDynamics, (series, end, false), runner);
        Ok(())
    }

    fn add(
        &mut self,
        closing: &Closing<'_>,
        question: Question,
        (series, end, default): (String, End, bool),
        runner: Box<dyn Runner>,
    ) {
        let Closing { place, start, .. } = *closing;
        self.all.push(Method {
            question,
            series,
            label: end.label(),
            default,
            place,
            start,
            runner,
            ns: f64::NAN,
            error: f64::NAN,
            residual: None,
            fault: None,
        });
    }
}

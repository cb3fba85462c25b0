//! Every method that is measured on a robot: how loops are closed and how well, in which scalar,
//! how forward dynamics go.

use sarrus_dynamics::{Method as Forward, Model, Plan, PlanScalar};

use super::runner::{Implicit, Planned, Runner, with_start};
use crate::Outcome;
use crate::robots::Robot;
use crate::robots::{Question, Start, Subject, Variant};

/// Ends of Newton's method where only it is question, and where dynamics follow; a tolerance of the
/// last step each.
const TOLERANCES: [f64; 13] =
    [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15];
const FEW_TOLERANCES: [f64; 5] = [1e-3, 1e-6, 1e-9, 1e-12, 1e-15];
/// Bounded steps, from a closed pose nearby and from that at zero.
const STEPS: [u32; 5] = [1, 2, 3, 4, 6];
const STEPS_FROM_ZERO: [u32; 6] = [1, 2, 3, 4, 6, 8];
/// Tree velocities up to which dense systems are measured.
const LARGEST_SQUARE: usize = 100;

/// A method with one setting.
pub(super) struct Method {
    pub(super) question: Question,
    /// Its name in the legend and its setting.
    pub(super) series: String,
    pub(super) label: String,
    /// The defaults.
    pub(super) default: bool,
    /// Which variant of the robot it is, and where its Newton's method starts.
    pub(super) place: usize,
    pub(super) start: Start,
    pub(super) runner: Box<dyn Runner>,
}

/// A way to close loops: the variant, its name, where Newton's method starts.
#[derive(Clone, Copy)]
struct Closing<'a> {
    place: usize,
    variant: &'a Variant,
    name: &'static str,
    start: Start,
    default: bool,
}

/// The methods collected so far.
struct Methods<'a> {
    robot: &'a Robot,
    all: Vec<Method>,
}

/// All of a robot.
pub(super) fn of_robot(robot: &Robot) -> Outcome<Vec<Method>> {
    let mut methods = Methods { robot, all: Vec::new() };
    let given = robot.variants.first().ok_or("no variant")?;
    let numerical = robot.variants.iter().position(|variant| variant.closures == "numerical");
    let chain = matches!(robot.subject, Subject::Chain(_));
    let closed_form = chain || given.closures == "analytic";
    if given.closures != "numerical" {
        let (name, start) =
            if closed_form { ("closed form", Start::None) } else { ("as given", Start::Warm) };
        methods.given(Closing { place: 0, variant: given, name, start, default: true })?;
    }
    if let Some(place) = numerical {
        let variant = &robot.variants[place];
        methods.newton(Closing {
            place,
            variant,
            name: "Newton, warm",
            start: Start::Warm,
            default: place == 0,
        })?;
        methods.cold(Closing {
            place,
            variant,
            name: "Newton, cold",
            start: Start::Cold,
            default: false,
        })?;
    }
    Ok(methods.all)
}

impl Methods<'_> {
    /// Closed forms, or the closures of the robot's file.
    fn given(&mut self, closing: Closing<'_>) -> Outcome {
        let model = &closing.variant.compiled.model;
        for question in [Question::State, Question::InverseDynamics] {
            self.ask(&closing, model, question, "double", "", closing.default)?;
        }
        self.forward(&closing, model, "", closing.default)?;
        if model.sizes().n_v <= LARGEST_SQUARE {
            self.implicit(&closing, model, "")?;
        }
        Ok(())
    }

    /// Newton's method from a closed pose nearby, ended everywhere.
    fn newton(&mut self, closing: Closing<'_>) -> Outcome {
        let model = &closing.variant.compiled.model;
        let small = model.sizes().n_v <= LARGEST_SQUARE;
        for tolerance in TOLERANCES {
            let (looser, label) =
                (model.with_tolerance(tolerance, 10), format!("tolerance {tolerance:.0e}"));
            self.ask(&closing, &looser, Question::State, "double", &label, false)?;
            if FEW_TOLERANCES.contains(&tolerance) {
                self.ask(&closing, &looser, Question::InverseDynamics, "double", &label, false)?;
                self.ask(
                    &closing,
                    &looser,
                    Question::Forced(model.forward_method()),
                    "double",
                    &label,
                    false,
                )?;
                if small {
                    self.implicit(&closing, &looser, &label)?;
                }
            }
        }
        for question in [Question::State, Question::InverseDynamics] {
            self.ask(&closing, model, question, "double", "usual end", closing.default)?;
        }
        self.forward(&closing, model, "usual end", closing.default)?;
        for steps in STEPS {
            let (bounded, label) =
                (model.with_tolerance(0.0, steps), format!("at most {steps} steps"));
            self.ask(&closing, &bounded, Question::State, "double, bounded steps", &label, false)?;
            if steps <= 3 {
                self.ask(
                    &closing,
                    &bounded,
                    Question::InverseDynamics,
                    "double, bounded steps",
                    &label,
                    false,
                )?;
            }
        }
        Ok(())
    }

    /// Newton's method from the closed pose at zero: more steps, so that more of them can be left
    /// out.
    fn cold(&mut self, closing: Closing<'_>) -> Outcome {
        let model = &closing.variant.compiled.model;
        for tolerance in FEW_TOLERANCES {
            let label = format!("tolerance {tolerance:.0e}");
            self.ask(
                &closing,
                &model.with_tolerance(tolerance, 10),
                Question::State,
                "double",
                &label,
                false,
            )?;
        }
        self.ask(&closing, model, Question::State, "double", "usual end", false)?;
        for steps in STEPS_FROM_ZERO {
            let label = format!("at most {steps} steps");
            self.ask(
                &closing,
                &model.with_tolerance(0.0, steps),
                Question::State,
                "double, bounded steps",
                &label,
                false,
            )?;
        }
        Ok(())
    }

    /// Forward dynamics by every method that fits.
    fn forward(
        &mut self,
        closing: &Closing<'_>,
        model: &Model,
        label: &str,
        default: bool,
    ) -> Outcome {
        let small = model.sizes().n_v <= LARGEST_SQUARE;
        for method in Forward::ALL {
            if small || method != Forward::Kkt {
                self.ask(
                    closing,
                    model,
                    Question::Forced(method),
                    "double",
                    label,
                    default && method == model.forward_method(),
                )?;
            }
        }
        Ok(())
    }

    fn ask<T: PlanScalar>(
        &mut self,
        closing: &Closing<'_>,
        model: &Model<T>,
        question: Question,
        scalar: &str,
        label: &str,
        default: bool,
    ) -> Outcome {
        let query = with_start(question.query(), closing.start);
        let (plan, before) = match question {
            Question::Forced(method) => {
                (Plan::with_method(model, &query, method)?, format!("{}, ", method.name()))
            }
            _ => (Plan::new(model, &query)?, String::new()),
        };
        let runner = Box::new(Planned::new(model.clone(), plan, self.robot, closing.place));
        let series = format!("{before}{}, {scalar}", closing.name);
        let question = if question.is_forward() { Question::ForwardDynamics } else { question };
        let label = if label.is_empty() { "usual" } else { label }.to_owned();
        self.all.push(Method {
            question,
            series,
            label,
            default,
            place: closing.place,
            start: closing.start,
            runner,
        });
        Ok(())
    }

    fn implicit(&mut self, closing: &Closing<'_>, model: &Model, label: &str) -> Outcome {
        let runner = Box::new(Implicit::new(model, self.robot, closing.place, closing.start)?);
        let label = if label.is_empty() { "usual" } else { label }.to_owned();
        let series = format!("implicit form with Baumgarte, {}, double", closing.name);
        let question = Question::ForwardDynamics;
        let default = false;
        self.all.push(Method {
            question,
            series,
            label,
            default,
            place: closing.place,
            start: closing.start,
            runner,
        });
        Ok(())
    }
}

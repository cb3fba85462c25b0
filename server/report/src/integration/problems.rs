//! The integrated problems: mechanisms with published motions, and robots on springs.

use std::f64::consts::PI;

use sarrus_models::{Loaded, Options, Source, load};
use sarrus_simulation::{
    Input, Method, Point, Run, Settings, Setup, Space, Spring, Start, simulate,
};

use super::{four_bars, pendulum};
use crate::Outcome;

/// A robot, its springs and inputs, and its start.
pub(super) struct Problem {
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    pub(super) loaded: Loaded,
    pub(super) springs: Vec<Spring>,
    pub(super) inputs: Vec<Input>,
    pub(super) y: Vec<f64>,
    pub(super) yd: Vec<f64>,
    /// Duration `[s]`.
    pub(super) duration: f64,
    /// Longest step of the fixed-step methods; the others are halves of it.
    pub(super) step: f64,
    /// The end from another source.
    pub(super) known: Option<Known>,
}

/// The end of a motion.
pub(super) struct Known {
    /// y and ẏ.
    pub(super) end: [Vec<f64>; 2],
    pub(super) from: &'static str,
    /// Its accuracy, by size.
    pub(super) to: f64,
}

impl Problem {
    pub(super) fn new(
        id: &'static str,
        title: &'static str,
        source: &Source,
        [duration, step]: [f64; 2],
    ) -> Outcome<Problem> {
        let loaded = load(source, &Options::default())?;
        let sizes = loaded.compiled.model.sizes();
        Ok(Problem {
            id,
            title,
            springs: Vec::new(),
            inputs: Vec::new(),
            y: vec![0.0; sizes.n_qy],
            yd: vec![0.0; sizes.n_vy],
            loaded,
            duration,
            step,
            known: None,
        })
    }

    /// Adds a spring between points of two links: stiffness, damping, rest length.
    fn spring(
        mut self,
        from: (&str, [f64; 3]),
        to: (&str, [f64; 3]),
        [stiffness, damping, rest]: [f64; 3],
    ) -> Outcome<Problem> {
        let links = self.loaded.compiled.model.link_names();
        let link = |name: &str| {
            links
                .iter()
                .position(|of| of == name)
                .ok_or_else(|| format!("{}: no link {name}", self.id))
        };
        let point = |(name, at): (&str, [f64; 3])| link(name).map(|link| Point { link, at });
        self.springs.push(Spring { from: point(from)?, to: point(to)?, stiffness, damping, rest });
        Ok(self)
    }

    /// From the start to the end.
    pub(super) fn run(&self, settings: &Settings) -> Outcome<Run> {
        let setup = Setup {
            description: &self.loaded.description,
            compiled: &self.loaded.compiled,
            springs: &self.springs,
            inputs: &self.inputs,
        };
        let start = Start::Independent { y: self.y.clone(), yd: self.yd.clone(), guess: None };
        Ok(simulate(&setup, &start, settings, &mut |_| ())?)
    }

    /// By a method with its own step.
    pub(super) fn adaptive(&self, method: Method, tolerance: f64) -> Settings {
        Settings { rtol: tolerance, atol: tolerance, ..self.settings(method) }
    }

    /// By a method with only one sample, at the end.
    pub(super) fn settings(&self, method: Method) -> Settings {
        Settings { every: Some(self.duration), ..Settings::new(method, self.duration) }
    }
}

/// Every problem, in the order of the page; a quick report omits the row of forty.
pub(super) fn all(quick: bool) -> Outcome<Vec<Problem>> {
    let arm = |problem: Problem, side: &str| {
        let hand = format!("A{side}WristRoll_Link");
        problem.spring(("base_link", [0.3, 0.0, 0.3]), (&hand, [0.0; 3]), [200.0, 2.0, 0.3])
    };
    let lambda = Problem::new("lambda", "Lambda on a spring to 2 s", &own("lambda"), [2.0, 8e-3])?;
    let torso = Problem::new("torso", "Torso on a spring to 1 s", &own("torso"), [1.0, 4e-3])?;
    let title = "Upper body, both hands on springs, to 0.5 s";
    let upper_body = Problem::new("upper_body", title, &own("rh5v2_upper_body"), [0.5, 2e-3])?;
    let bricard = "Bricard's mechanism to 1 s, overconstrained";
    let mut problems = vec![
        squeezer()?,
        row("four_bars_2", "2 four-bars in a row to 10 s, through the flat pose", 2, 10.0)?,
        Problem::new("bricard", bricard, &own("bricard"), [1.0, 1e-2])?,
        governor()?,
        lambda.spring(
            ("base_link", [0.0; 3]),
            ("Elbow_Link", [0.0, 0.1, 0.2]),
            [500.0, 1.0, 0.1],
        )?,
        torso.spring(
            ("base_link", [0.2, 0.0, 0.0]),
            ("BodyRoll_Link", [0.2, 0.1, 0.2]),
            [2000.0, 5.0, 0.2],
        )?,
        arm(arm(upper_body, "L")?, "R")?,
    ];
    if !quick {
        let title = "40 four-bars in a row to 2 s, through the flat pose";
        problems.insert(2, row("four_bars_40", title, 40, 2.0)?);
    }
    Ok(problems)
}

/// A bundled robot.
pub(super) fn own(name: &str) -> Source {
    Source::Bundled(name.to_owned())
}

fn squeezer() -> Outcome<Problem> {
    let mut squeezer =
        Problem::new("squeezer", "Andrews' squeezer to 0.03 s", &own("squeezer"), [0.03, 1e-4])?
            .spring(
                ("ground", [0.014, 0.072, 0.0]),
                ("K3", [0.02, -0.018, 0.0]),
                [4530.0, 0.0, 0.07785],
            )?;
    squeezer.inputs.push(Input {
        space: Space::Actuator,
        source: sarrus_simulation::Source::Constant(vec![0.033]),
    });
    squeezer.known = Some(Known {
        end: [vec![15.81077119629904 + 0.061713890014276454], vec![1139.920302151208]],
        from: "the IVP test set",
        to: 1e-9,
    });
    Ok(squeezer)
}

/// Four-bars in a row, which move as one pendulum.
fn row(id: &'static str, title: &'static str, n: usize, duration: f64) -> Outcome<Problem> {
    let mut row = Problem::new(id, title, &four_bars(n), [duration, 1e-2])?;
    row.yd[0] = -1.0;
    let [angle, rate] = pendulum(n as f64, [0.5 * PI, -1.0], duration);
    row.known = Some(Known {
        end: [vec![angle - 0.5 * PI], vec![rate]],
        from: "the parallelogram branch as one pendulum",
        to: 1e-12,
    });
    Ok(row)
}

fn governor() -> Outcome<Problem> {
    let governor = include_str!("governor.urdf").as_bytes().to_vec();
    let governor = Source::Text { urdf: governor, submechanisms: None };
    let mut governor =
        Problem::new("governor", "Flyball governor to 0.5 s, stiff", &governor, [0.5, 1e-4])?;
    for rod in ["right_rod", "left_rod"] {
        governor =
            governor.spring((rod, [0.5, 0.0, 0.0]), ("slider", [0.0; 3]), [8e5, 4e4, 0.5])?;
    }
    governor.yd[0] = 2.0 * PI;
    Ok(governor)
}

//! The robots of the laws, bundled and random, each loaded once, and random states of them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

use sarrus_dynamics::Compiled;
use sarrus_dynamics::description::{Description, JointKind, Terms};
use sarrus_dynamics::scalar::Real;
use sarrus_models::{Options, Source, load};

use crate::compare::error_by_size;
use crate::random::{Text, random_robot};
use crate::reference::{LEGS, REDUNDANT, ROBOTS};
use crate::seed::Seeded;

/// Number of random robots, with seeds from 0.
pub const SEEDS: u64 = 240;

/// One robot under test.
#[derive(Clone, Debug)]
pub struct Case {
    /// The robot's name, or its seed and mechanisms.
    pub name: String,
    /// Seed of the random states.
    pub seed: u64,
    /// The robot as read from its files.
    pub description: Description,
    /// The compiled models.
    pub compiled: Compiled,
    /// Largest |y| of random states (n_vy); a floating base has no limit.
    pub reach: Vec<f64>,
    /// Each mechanism has as many actuators as independent joints.
    pub square: bool,
    /// Placements are rounded to six decimals.
    pub rounded: bool,
    /// A typical length of the robot `[m]`.
    pub scale: f64,
}

/// Independent coordinates with their velocities and accelerations.
#[derive(Clone, Debug)]
pub struct State<T> {
    /// Independent coordinates, velocities, accelerations.
    pub y: Vec<T>,
    /// ẏ.
    pub yd: Vec<T>,
    /// ÿ.
    pub ydd: Vec<T>,
}

impl Case {
    /// A bundled robot.
    pub fn bundled(name: &str) -> Case {
        let loaded = load(&Source::Bundled(name.into()), &Options::default())
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let compiled = loaded.compiled;
        let kind = |joint: &str| {
            loaded.description.joints.iter().find(|x| x.name == joint).map(|x| x.kind)
        };
        let reach = compiled.model.independent_names().iter();
        // motors of the planar platform stretch its legs from 0.2 on
        let turn = if name == "three_rrr" { 0.15 } else { 0.25 };
        let reach = reach
            .map(|joint| if kind(joint) == Some(JointKind::Prismatic) { 0.04 } else { turn })
            .collect();
        let seed = name
            .bytes()
            .fold(1000_u64, |sum, byte| sum.wrapping_mul(31).wrapping_add(u64::from(byte)));
        let sizes = compiled.model.sizes();
        Case {
            name: name.into(),
            seed,
            description: loaded.description,
            compiled,
            reach,
            square: sizes.n_u == sizes.n_vy,
            rounded: false,
            scale: 0.3,
        }
    }

    /// A robot from text.
    pub fn of_text(text: &Text, seed: u64, options: &Options) -> Result<Case, String> {
        let loaded = text.load(options).map_err(|error| format!("{}\n{error}", text.holds))?;
        let compiled = loaded.compiled;
        let of = |name: &String| text.reach.iter().find(|x| x.0 == *name).map_or(0.0, |x| x.1);
        let reach = compiled.model.independent_names().iter().map(of).collect();
        let square = text.square;
        let rounded = text.rounded;
        let scale = text.scale;
        Ok(Case {
            name: text.holds.clone(),
            seed,
            description: loaded.description,
            compiled,
            reach,
            square,
            rounded,
            scale,
        })
    }

    /// Error of the closed loops that no precision removes: the misfit of a closed form within the
    /// accepted rounding, and the contradiction of redundant rows whose placements are rounded.
    pub fn contradiction(&self) -> f64 {
        let closures = self.compiled.model.closures();
        let misfit = closures
            .iter()
            .fold(0.0, |worst: f64, x| worst.max(if x.misfit <= 1e-13 { x.misfit } else { 0.0 }));
        // a rod that spins freely about itself has its inertia on that axis only up to rounding
        let redundant = closures.iter().any(|x| x.rank < x.rows || !x.idle.is_empty());
        match (redundant, self.rounded) {
            (true, true) => 1e-4,
            (true, false) => 1e-10,
            _ => 30.0 * misfit,
        }
    }

    /// True if some joint has damping, a spring or a rotor.
    pub fn has_terms(&self) -> bool {
        self.description.joints.iter().any(|joint| joint.terms != Terms::default())
    }

    /// True if some joint is a quaternion, whose position the actuators do not determine: a
    /// floating base or a ball joint.
    pub fn floats(&self) -> bool {
        self.compiled.model.sizes().n_q > self.compiled.model.sizes().n_v
    }

    /// True if the robot has no loop and no coupling.
    pub fn is_open(&self) -> bool {
        self.compiled.model.sizes().n_c == 0
    }

    /// The k-th random state.
    pub fn state<T: Real>(&self, k: u64) -> State<T> {
        let mut seeded = Seeded::new(self.seed.wrapping_mul(1000).wrapping_add(k));
        let number = |x: f64| T::from_f64(x);
        let model = &self.compiled.model;
        let mut y = Vec::new();
        let mut yd = Vec::new();
        let mut ydd = Vec::new();
        for (name, reach) in model.independent_names().iter().zip(&self.reach) {
            if let Some(joint) = name.strip_suffix("/rx") {
                // a floating joint has a position and a quaternion for its six freedoms, a ball
                // joint a quaternion for its three
                if model.independent_names().contains(&format!("{joint}/tx")) {
                    y.extend(seeded.vector(self.scale).map(number));
                }
                let turn: [T; 4] = [(); 4].map(|()| number(seeded.within(-1.0, 1.0) + 0.3));
                let length = turn.iter().fold(T::ZERO, |sum, x| sum + *x * *x).sqrt();
                y.extend(turn.map(|x| x / length));
            } else if !name.contains('/') {
                y.push(number(seeded.within(-1.0, 1.0) * reach));
            }
            let slides = self
                .description
                .joints
                .iter()
                .any(|joint| joint.name == *name && joint.kind == JointKind::Prismatic);
            let size = if slides || name.contains("/t") { self.scale } else { 1.0 };
            yd.push(number(seeded.within(-1.5, 1.5) * size));
            ydd.push(number(seeded.within(-4.0, 4.0) * size));
        }
        State { y, yd, ydd }
    }
}

/// Every robot.
pub fn robots() -> &'static [Case] {
    static ROBOTS_ONCE: OnceLock<Vec<Case>> = OnceLock::new();
    ROBOTS_ONCE.get_or_init(|| {
        let bundled = ROBOTS.iter().chain(&REDUNDANT);
        let mut robots: Vec<Case> = bundled.map(|name| Case::bundled(name)).collect();
        // a robot that fails to load fails a test of its own
        robots.extend(
            (0..SEEDS).filter_map(|seed| {
                Case::of_text(&random_robot(seed), seed, &Options::default()).ok()
            }),
        );
        robots.extend(LEGS.iter().map(|name| Case::bundled(name)));
        robots
    })
}

/// Errors of the laws over all robots.
#[derive(Debug, Default)]
pub struct Ledger {
    laws: Vec<Entry>,
}

/// Worst result of one law, or of one panic message.
#[derive(Debug)]
struct Entry {
    what: String,
    /// Largest error, relative to its bound and absolute, and its robot.
    ratio: f64,
    error: f64,
    worst: String,
    /// Failures, and the first robots that fail.
    failures: usize,
    failing: Vec<String>,
}

impl Ledger {
    /// Checks every robot and records a panic as a failure of that robot.
    pub fn over<'a>(
        cases: impl IntoIterator<Item = &'a Case>,
        mut check: impl FnMut(&'a Case, &mut Ledger),
    ) {
        let mut ledger = Ledger::default();
        for case in cases {
            if let Err(cause) = catch_unwind(AssertUnwindSafe(|| check(case, &mut ledger))) {
                let cause = cause
                    .downcast_ref::<String>()
                    .cloned()
                    .or(cause.downcast_ref::<&str>().map(|x| (*x).to_owned()));
                ledger.note(
                    &cause.unwrap_or_default().replace('\n', " "),
                    case,
                    f64::INFINITY,
                    1.0,
                );
            }
        }
        ledger.finish();
    }

    /// Records an error, as a failure if it exceeds its bound or is NaN.
    pub fn note(&mut self, what: &str, case: &Case, error: f64, allowed: f64) {
        let ratio = if error == 0.0 { 0.0 } else { error / allowed };
        let ratio = if ratio.is_nan() { f64::INFINITY } else { ratio };
        let at = self.laws.iter().position(|law| law.what == what).unwrap_or_else(|| {
            let what = what.to_owned();
            let worst = String::new();
            self.laws.push(Entry {
                what,
                ratio: -1.0,
                error: 0.0,
                worst,
                failures: 0,
                failing: Vec::new(),
            });
            self.laws.len() - 1
        });
        let law = &mut self.laws[at];
        if ratio > law.ratio {
            (law.ratio, law.error, law.worst) = (ratio, error, case.name.clone());
        }
        if ratio > 1.0 {
            law.failures += 1;
            if law.failing.len() < 4 && !law.failing.contains(&case.name) {
                law.failing.push(case.name.clone());
            }
        }
    }

    /// Records the difference of two arrays relative to their size.
    pub fn compare<T: Real>(
        &mut self,
        what: &str,
        case: &Case,
        a: &[T],
        b: &[T],
        least: f64,
        allowed: f64,
    ) {
        self.note(what, case, error_by_size(a, b, least), allowed);
    }

    /// Prints the worst error of each law, and panics if one failed.
    pub fn finish(self) {
        let mut broken = String::new();
        for law in &self.laws {
            let Entry { what, ratio, error, worst, failures, failing } = law;
            println!("{what:<50} worst {error:.2e}, {ratio:.1e} of what is allowed, on {worst}");
            if *failures > 0 {
                broken += &format!(
                    "\n{what}: {failures} failures, worst {error:.2e} ({ratio:.1e}) on {worst}; \
                     first {}",
                    failing.join(" | ")
                );
            }
        }
        assert!(broken.is_empty(), "{broken}");
    }
}

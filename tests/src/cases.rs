//! The robots that the laws are checked on: the bundled ones and random ones, read once, with
//! random states.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

use sarrus_dynamics::Compiled;
use sarrus_dynamics::description::{Description, JointKind, Terms};
use sarrus_dynamics::scalar::Real;
use sarrus_models::{Options, Source, load};

use crate::compare::error_by_size;
use crate::random::{Text, random_robot};
use crate::reference::ROBOTS;
use crate::seed::Seeded;

/// Random robots: seeds 0 to this less one.
pub const SEEDS: u64 = 240;

/// One robot to check.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name, or its seed and what it holds.
    pub name: String,
    /// The seed of its states.
    pub seed: u64,
    /// What its files say.
    pub description: Description,
    /// The models.
    pub compiled: Compiled,
    /// How far each independent coordinate may go (n_vy); the freedoms of a floating base have
    /// none.
    pub reach: Vec<f64>,
    /// Each mechanism has as many actuators as independent joints.
    pub square: bool,
    /// Its placements are rounded to six decimals.
    pub rounded: bool,
    /// A length that is typical of it `[m]`.
    pub scale: f64,
}

/// Where a robot is, how it moves and what pushes it.
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
        let reach = reach
            .map(|joint| if kind(joint) == Some(JointKind::Prismatic) { 0.04 } else { 0.25 })
            .collect();
        let seed = name.bytes().fold(1000, |sum, byte| 31 * sum + u64::from(byte));
        Case {
            name: name.into(),
            seed,
            description: loaded.description,
            compiled,
            reach,
            square: true,
            rounded: false,
            scale: 0.3,
        }
    }

    /// A robot of text.
    pub fn of_text(text: &Text, seed: u64, options: &Options) -> Result<Case, String> {
        let loaded = text.load(options).map_err(|error| format!("{}\n{error}", text.holds))?;
        let compiled = loaded.compiled;
        let of = |name: &String| text.reach.iter().find(|x| x.0 == *name).map_or(0.0, |x| x.1);
        let reach = compiled.model.independent_names().iter().map(of).collect();
        let (square, rounded, scale) = (text.square, text.rounded, text.scale);
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

    /// How far the rows of the loops contradict each other or the closed forms, which no precision
    /// corrects: the misfit of a closed form that counts as rounding, and the redundant rows of
    /// placements that are rounded.
    pub fn contradiction(&self) -> f64 {
        let closures = self.compiled.model.closures();
        let misfit = closures
            .iter()
            .fold(0.0, |worst: f64, x| worst.max(if x.misfit <= 1e-13 { x.misfit } else { 0.0 }));
        // a rod that spins about itself has its mass there only up to rounding
        let redundant = closures.iter().any(|x| x.rank < x.rows || !x.idle.is_empty());
        match (redundant, self.rounded) {
            (true, true) => 1e-4,
            (true, false) => 1e-10,
            _ => 30.0 * misfit,
        }
    }

    /// True where damping, springs or rotors act in some joint.
    pub fn has_terms(&self) -> bool {
        self.description.joints.iter().any(|joint| joint.terms != Terms::default())
    }

    /// True where some joint is a quaternion: a floating base or a ball, whose place no actuator
    /// can tell.
    pub fn floats(&self) -> bool {
        self.compiled.model.sizes().n_q > self.compiled.model.sizes().n_v
    }

    /// True where no joint is tied to another.
    pub fn is_open(&self) -> bool {
        self.compiled.model.sizes().n_c == 0
    }

    /// The k-th random state.
    pub fn state<T: Real>(&self, k: u64) -> State<T> {
        let mut seeded = Seeded::new(self.seed.wrapping_mul(1000).wrapping_add(k));
        let number = |x: f64| T::from_f64(x);
        let model = &self.compiled.model;
        let (mut y, mut yd, mut ydd) = (Vec::new(), Vec::new(), Vec::new());
        for (name, reach) in model.independent_names().iter().zip(&self.reach) {
            if let Some(joint) = name.strip_suffix("/rx") {
                // a floating joint: position and quaternion stand for its six degrees of freedom; a
                // ball joint: a quaternion for its three
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
        let mut robots: Vec<Case> = ROBOTS.iter().map(|name| Case::bundled(name)).collect();
        // a robot that cannot be read fails a test of its own
        robots.extend(
            (0..SEEDS).filter_map(|seed| {
                Case::of_text(&random_robot(seed), seed, &Options::default()).ok()
            }),
        );
        robots
    })
}

/// The errors of the laws over all robots.
#[derive(Debug, Default)]
pub struct Ledger {
    laws: Vec<Entry>,
}

/// What became of one law, or of one way to panic.
#[derive(Debug)]
struct Entry {
    what: String,
    /// Largest error, as a share of what is allowed and as it is, and where.
    ratio: f64,
    error: f64,
    worst: String,
    /// Failures, and the first robots that fail.
    failures: usize,
    failing: Vec<String>,
}

impl Ledger {
    /// Checks every robot; what panics is a failure of that robot.
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

    /// Notes an error; a failure where it is larger than allowed, or not a number.
    pub fn note(&mut self, what: &str, case: &Case, error: f64, allowed: f64) {
        let ratio = if error == 0.0 { 0.0 } else { error / allowed };
        let ratio = if ratio.is_nan() { f64::INFINITY } else { ratio };
        let at = self.laws.iter().position(|law| law.what == what).unwrap_or_else(|| {
            let (what, worst) = (what.to_owned(), String::new());
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

    /// Notes how far two arrays are apart by size.
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

    /// Prints the worst of each law and fails where one does not hold.
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

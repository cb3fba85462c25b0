//! Robots over time: references, orders of convergence, energy and momentum, a change of
//! independents, refused simulations.

mod failures;
mod floating;
mod implicit;
mod orders;
mod references;
mod switching;

use sarrus_models::{Loaded, Options, Source, load};
use sarrus_simulation::{Input, Method, Point, Run, Settings, Setup, Spring, Start, simulate};

/// A robot with its springs, forces and dampers.
struct Robot {
    loaded: Loaded,
    springs: Vec<Spring>,
    inputs: Vec<Input>,
}

impl Robot {
    fn of(source: &Source, gravity: [f64; 3]) -> Robot {
        let options = Options { gravity, ..Options::default() };
        let loaded = load(source, &options).unwrap_or_else(|error| panic!("{error}"));
        Robot { loaded, springs: Vec::new(), inputs: Vec::new() }
    }

    fn bundled(name: &str) -> Robot {
        Robot::of(&Source::Bundled(name.into()), Options::default().gravity)
    }

    fn text(urdf: &str, submechanisms: Option<&str>) -> Robot {
        let bytes = |text: &str| text.as_bytes().to_vec();
        Robot::of(
            &Source::Text { urdf: bytes(urdf), submechanisms: submechanisms.map(bytes) },
            Options::default().gravity,
        )
    }

    /// Adds a spring between points of two links.
    fn spring(
        &mut self,
        from: (&str, [f64; 3]),
        to: (&str, [f64; 3]),
        [stiffness, damping, rest]: [f64; 3],
    ) {
        let links = self.loaded.compiled.model.link_names();
        let [from, to] = [from, to].map(|(name, at)| Point {
            link: links.iter().position(|link| link == name).unwrap(),
            at,
        });
        self.springs.push(Spring { from, to, stiffness, damping, rest });
    }

    fn setup(&self) -> Setup<'_> {
        Setup {
            description: &self.loaded.description,
            compiled: &self.loaded.compiled,
            springs: &self.springs,
            inputs: &self.inputs,
        }
    }

    fn run(&self, start: &Start, settings: &Settings) -> Run {
        simulate(&self.setup(), start, settings, &mut |_| ())
            .unwrap_or_else(|error| panic!("{error}"))
    }
}

/// A start from independents without a guess.
fn from(y: &[f64], yd: &[f64]) -> Start {
    Start::Independent { y: y.to_vec(), yd: yd.to_vec(), guess: None }
}

/// Settings of a method with adaptive step, to the end.
fn adaptive(method: Method, tolerance: f64, duration: f64) -> Settings {
    Settings {
        rtol: tolerance,
        atol: tolerance,
        every: Some(duration),
        ..Settings::new(method, duration)
    }
}

/// Settings of a method with fixed step.
fn fixed(method: Method, step: f64, duration: f64) -> Settings {
    Settings { step: Some(step), every: Some(duration), ..Settings::new(method, duration) }
}

/// The last state of a run that reached its end.
fn arrived(run: &Run) -> &sarrus_simulation::Sample {
    assert!(run.end.is_finished(), "{:?} at {} after {:?}", run.end, run.time, run.counts);
    run.last().unwrap()
}

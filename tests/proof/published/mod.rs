//! Mechanisms with published numbers or with a closed form that is implemented here independently:
//! closures to 1e-14 by size, accelerations to 1e-11.

#![allow(clippy::excessive_precision, reason = "published numbers stand as they were published")]

mod bricard;
mod cuts;
mod legs;
mod linkages;
mod planar;
mod platforms;
mod squeezer;

use sarrus_dynamics::{Compiled, Field, FieldSet, Query, Request};
use sarrus_models::{Options, Source, load};
use sarrus_tests::run::Robot;
pub(crate) use squeezer::{SQUEEZER, SQUEEZER_END};

use Field::*;

fn compiled(source: &Source) -> Compiled {
    load(source, &Options::default()).unwrap_or_else(|error| panic!("{error}")).compiled
}

fn bundled(name: &str) -> Compiled {
    compiled(&Source::Bundled(name.into()))
}

fn link(robot: &Robot<f64>, name: &str) -> u16 {
    robot.model.link_names().iter().position(|link| link == name).unwrap() as u16
}

/// Position of a link's origin and its orientation x, y, z, w at y.
fn pose(robot: &mut Robot<f64>, name: &str, y: &[f64]) -> [f64; 7] {
    let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[FramePose]))
        .with_frames(&[link(robot, name)]);
    let answer = robot.ask_for(query, &[(Y, y)]).ok();
    std::array::from_fn(|i| answer.get(FramePose)[i])
}

/// A point of a frame that is given by position and quaternion.
fn point_of(frame: &[f64; 7], x: [f64; 3]) -> [f64; 3] {
    let [px, py, pz, qx, qy, qz, w] = *frame;
    let v = [qx, qy, qz];
    let t = cross(v, x).map(|x| 2.0 * x);
    let u = cross(v, t);
    [px + x[0] + w * t[0] + u[0], py + x[1] + w * t[1] + u[1], pz + x[2] + w * t[2] + u[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A moving robot of one degree of freedom: y, ẏ and its tree coordinates.
#[derive(Default)]
struct Motion {
    y: f64,
    yd: f64,
    q: Vec<f64>,
}

impl Motion {
    /// One Runge-Kutta step; `force` computes ÿ from y, ẏ and a guess of q.
    fn step(
        &mut self,
        robot: &mut Robot<f64>,
        step: f64,
        force: impl Fn(&mut Robot<f64>, f64, f64, &[f64]) -> f64,
    ) {
        let mut rate = |y: f64, yd: f64| (yd, force(robot, y, yd, &self.q));
        let y = self.y;
        let yd = self.yd;
        let a = rate(y, yd);
        let b = rate(y + 0.5 * step * a.0, yd + 0.5 * step * a.1);
        let c = rate(y + 0.5 * step * b.0, yd + 0.5 * step * b.1);
        let d = rate(y + step * c.0, yd + step * c.1);
        let mean = |a: f64, b: f64, c: f64, d: f64| step * (a + 2.0 * (b + c) + d) / 6.0;
        (self.y, self.yd) = (y + mean(a.0, b.0, c.0, d.0), yd + mean(a.1, b.1, c.1, d.1));
        self.q = closed(robot, self.y, &self.q);
    }
}

/// q at y on the guess's branch.
fn closed(robot: &mut Robot<f64>, y: f64, guess: &[f64]) -> Vec<f64> {
    robot.ask(Request::Kinematics, &[(Y, &[y]), (QGuess, guess)], &[Q]).ok().get(Q).to_vec()
}

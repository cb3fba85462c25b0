//! Families of robots that differ in one size.

use std::f64::consts::FRAC_1_SQRT_2;

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::{CutJoint, LinkId};
use sarrus_report::Outcome;
use sarrus_report::robots::chain::lambdas_in_a_row;
use sarrus_report::robots::small::{Turn, X, Y, Z, finish, joint, mechanism};
use sarrus_report::robots::{Own, Robot, Start, Subject};

/// Robots of several sizes.
pub(super) struct Family {
    /// The size that they differ in.
    pub(super) name: &'static str,
    /// The robots in words.
    pub(super) of: &'static str,
    pub(super) sizes: &'static [usize],
    /// Closed forms, or Newton's method from a guess that is 1 ms old.
    pub(super) start: Start,
    make: fn(usize) -> Outcome<Description>,
}

/// Every family.
pub(super) const FAMILIES: [Family; 4] = [
    Family {
        name: "bodies",
        of: "serial chain of N revolute joints",
        sizes: &[10, 30, 100, 300],
        start: Start::None,
        make: serial,
    },
    Family {
        name: "loops",
        of: "N lambdas in a row, each on the rocker of the one before, closed forms",
        sizes: &[1, 3, 10, 30, 100],
        start: Start::None,
        make: |n| Ok(lambdas_in_a_row(n, false).0.build()?),
    },
    Family {
        name: "joints",
        of: "one planar loop of N revolute joints, N − 3 independent, by Newton's method, guess \
            1 ms old",
        sizes: &[4, 6, 10, 20, 40],
        start: Start::Warm,
        make: polygon,
    },
    Family {
        name: "rods",
        of: "N rods on a row of N + 1 links, closed as one block by Newton's method, guess 1 ms \
            old",
        sizes: &[1, 2, 4, 8, 16],
        start: Start::Warm,
        make: braced,
    },
];

impl Family {
    /// The robot of one size with this many states.
    pub(super) fn load(&self, size: usize, states: usize) -> Outcome<Robot> {
        let mut description = (self.make)(size)?;
        description.name = format!("{}/{size}", self.name);
        let is_numerical = self.start != Start::None;
        for part in description.submechanisms.iter_mut().filter(|_| is_numerical) {
            part.closed_forms = false;
        }
        let closures = if is_numerical { "numerical" } else { "analytic" };
        let subject = Subject::Own(Own::new(description));
        let robot = Robot::load_some(subject, states, |name| name == closures)?;
        match robot.variants.len() {
            1 => Ok(robot),
            _ => Err(format!("{}: the loops are not {closures}", robot.name).into()),
        }
    }
}

/// A chain whose axes take turns.
fn serial(n: usize) -> Outcome<Description> {
    let mut of = mechanism(Kind::Serial);
    let mut links = Vec::new();
    let mut last = LinkId::BASE;
    for k in 0..n {
        last = joint(&mut of, last, Turn, [0.0, 0.05 * k as f64, 0.2 * k as f64], [X, Y, Z][k % 3]);
        links.push(last);
    }
    finish(of, &links, &links)
}

/// A row of N − 3 independent links along x, 1 m together, whose end two more links join to the
/// ground.
fn polygon(n: usize) -> Outcome<Description> {
    const ARM: f64 = 1.3;
    const GROUND: [f64; 3] = [0.6, -1.4, 0.0];
    let mut of = mechanism(Kind::Numerical);
    let mut independent = Vec::new();
    let mut last = LinkId::BASE;
    for k in 0..n - 3 {
        let at = [k as f64 / (n - 3) as f64, 0.0, 0.0];
        last = joint(&mut of, last, Turn, at, Z);
        independent.push(last);
    }
    let end = [1.0, 0.0, 0.0];
    // the elbow is an arm away from the end and from the ground
    let [x, y] = [GROUND[0] - end[0], GROUND[1]];
    let height = (ARM * ARM / (x * x + y * y) - 0.25).sqrt();
    let elbow = [end[0] + 0.5 * x - height * y, 0.5 * y + height * x, 0.0];
    last = joint(&mut of, last, Turn, end, Z);
    last = joint(&mut of, last, Turn, elbow, Z);
    of.cut("pin", LinkId::BASE, last).at(GROUND).joint(CutJoint::PlanarRevolute { axis: Z });
    finish(of, &independent, &independent)
}

/// A crank and a row of links from its end, each of whose ends is on a rod. Crank and rods are
/// equally long and lean alternately to both sides, so a motion neither grows nor fades along the
/// row. The last joint is the independent one: no rod's loop can be closed without the others.
fn braced(n: usize) -> Outcome<Description> {
    let lean = 1.2 * FRAC_1_SQRT_2;
    let mut of = mechanism(Kind::Numerical);
    let mut at = [lean, lean, 0.0];
    let mut last = joint(&mut of, LinkId::BASE, Turn, [0.0; 3], Z);
    for k in 0..n {
        last = joint(&mut of, last, Turn, at, Z);
        at[0] += 1.0;
        let side = if k % 2 == 0 { lean } else { -lean };
        let foot = [at[0] + side, at[1] - lean, 0.0];
        let rod = joint(&mut of, LinkId::BASE, Turn, foot, Z);
        let pin = of.cut(format!("pin{k}"), last, rod).at(at);
        pin.joint(CutJoint::PlanarRevolute { axis: Z });
    }
    finish(of, &[last], &[last])
}

//! Four-bars that fold flat, where their two assemblies meet: an answer must continue straight on
//! or report that it does not.

use std::f64::consts::PI;

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::{Field, Request, Status};

use crate::Outcome;
use crate::page::Assessment;
use crate::robots::random::Random;
use crate::stress::harness::{
    At, Case, Cases, Question, Robot, Turn, Z, cut, finish, joint, warned,
};
use crate::stress::mechanisms::BASE;
use crate::stress::mechanisms::plane::{Point, about, along, distance, intersections};
use crate::stress::mechanisms::trains::begun;

use Field::*;

/// Step of the reference path, in radians of the crank.
const FINE: f64 = 1e-4;
/// Difference between the rates of path and answer, relative to 1 and the rate, that indicates
/// another branch.
const OTHER: f64 = 0.1;
/// Largest rates that the path's differences resolve.
const SLOW: f64 = 20.0;

/// The request of a sequence, and its guesses from the last answer.
const WAYS: [(&str, &[Field]); 3] = [
    ("turn, from zero", &[]),
    ("turn, from the last", &[QGuess]),
    ("turn, along the last", &[QGuess, QdGuess]),
];

/// The four-bar of this seed, turned through its change points in every way.
pub(crate) fn one(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(4 << 32 | seed);
    let bars = Bars::drawn(&mut random);
    let step = random.scale(3e-3, 0.5);
    let direction = if random.coin() { 1.0 } else { -1.0 };
    let mut kinds = vec![(Kind::FourBar, "FOURBAR"), (Kind::Numerical, "NUMERICAL")];
    if bars.name == "parallelogram" {
        kinds.push((Kind::ParallelogramChain, "PARALLELOGRAMCHAIN"));
    }
    let seed_of_robot = random;
    for (kind, word) in kinds {
        let mut random = Random(seed_of_robot.0);
        let name = format!("{}, {word}, seed {seed}", bars.name);
        let at = At { value: step, method: word };
        let of = bars.robot(&mut random, kind)?;
        let Some(robot) = cases.load(&name, at, of) else { continue };
        for way in WAYS {
            sequence(cases, &robot, &bars, at, direction, way)?;
        }
    }
    Ok(())
}

/// Sends requests in sequence until the crank has turned by more than half.
fn sequence(
    cases: &mut Cases,
    robot: &Robot,
    bars: &Bars,
    at: At<'_>,
    direction: f64,
    (asked, guesses): (&str, &[Field]),
) -> Outcome {
    let mut y = 0.0;
    let mut path = Path::of(bars);
    let mut last: Option<[Vec<f64>; 2]> = None;
    let mut ok = 0;
    let mut refused = String::new();
    let mut jump = None;
    while f64::abs(y) < 3.6 {
        y += direction * at.value;
        if path.go(bars, y).is_none() {
            break;
        }
        let mut given = vec![(Y, vec![y]), (Yd, vec![direction])];
        given.extend(last.iter().flat_map(|last| guesses.iter().copied().zip(last.clone())));
        let ask = Question::new(Request::Kinematics, given, &[Q, Qd]);
        let answer = ask.run(&robot.compiled.model)?;
        if answer.status() != Status::Ok {
            if refused.is_empty() {
                refused = format!("{} at y = {y:.6}", answer.status().name());
            }
            if !answer.is_empty() {
                jump = Some((y, f64::INFINITY, "numbers beside a failure"));
                break;
            }
            continue;
        }
        ok += 1;
        let q = answer.get(Q).to_vec();
        let qd = answer.get(Qd).to_vec();
        let pin = bars.pin(q[2]);
        let near = distance(pin, path.pin);
        let far = distance(pin, path.other);
        let rate = path.rate(bars) * direction;
        let off = (qd[2] - rate).abs();
        if near > far {
            jump = Some((y, near, "pose"));
            break;
        }
        let has_warned = warned(answer.warnings(), "ill_conditioned");
        if rate.abs() < SLOW && off > OTHER * (1.0 + rate.abs()) && !has_warned {
            jump = Some((y, off, "rate"));
            break;
        }
        last = Some([q, qd]);
    }
    let assessment = match (jump, refused.is_empty()) {
        (Some(_), _) => Assessment::FailedSilently,
        (None, true) => Assessment::Held,
        (None, false) => Assessment::Failed,
    };
    let reported = match jump {
        Some((y, _, what)) => {
            format!("{what} of the other branch at y = {y:.6}, step {:e}", at.value)
        }
        None => format!("{ok} poses ok"),
    };
    cases.all.push(Case {
        status: if refused.is_empty() { "ok".into() } else { refused },
        error: jump.map(|(_, by, _)| by),
        reference: "the path in small steps",
        reported,
        assessment,
        ..cases.blank(&robot.name, at, asked)
    });
    Ok(())
}

/// Crank, coupler, rocker, and the ground along x; the crank's angle and the side of the pin at
/// zero.
pub(crate) struct Bars {
    pub(crate) name: &'static str,
    pub(crate) crank: f64,
    pub(crate) coupler: f64,
    pub(crate) rocker: f64,
    pub(crate) ground: f64,
    pub(crate) zero: f64,
    pub(crate) pin: Point,
}

impl Bars {
    /// Bars that fold flat, at a zero pose away from it.
    fn drawn(random: &mut Random) -> Bars {
        loop {
            let [a, b, c] = [(); 3].map(|()| random.between(0.5, 2.0));
            let (name, [crank, coupler, rocker, ground]) = match random.below(7) {
                0 | 1 => ("parallelogram", [a, b, a, b]),
                2 => ("antiparallelogram", [a, b, a, b]),
                3 => ("kite, crank and ground equal", [a, b, b, a]),
                4 => ("kite, crank and coupler equal", [a, a, b, b]),
                5 => ("flat stretched", [a, b, c, b + c - a]),
                _ => ("flat folded", [a, b, c, a + c - b]),
            };
            let zero = random.between(0.5, PI - 0.5);
            let wide = [crank, coupler, rocker, ground];
            let least = 0.2;
            let mut bars = Bars { name, crank, coupler, rocker, ground, zero, pin: [0.0; 2] };
            let Some(pins) = bars.pins(0.0) else { continue };
            let tip = bars.tip(0.0);
            let parallel = [tip[0] + ground, tip[1]];
            let nearest = usize::from(distance(pins[1], parallel) < distance(pins[0], parallel));
            bars.pin = match name {
                "parallelogram" => pins[nearest],
                "antiparallelogram" => pins[1 - nearest],
                _ => pins[random.below(2)],
            };
            let open = distance(pins[0], pins[1]) > 0.3;
            if open && wide.iter().all(|bar| *bar > least) {
                return bars;
            }
        }
    }

    fn tip(&self, y: f64) -> Point {
        along([0.0; 2], self.zero + y, self.crank)
    }

    /// Both pins between coupler and rocker.
    pub(crate) fn pins(&self, y: f64) -> Option<[Point; 2]> {
        // the flat pose is reachable
        let pivot = [self.ground, 0.0];
        intersections((self.tip(y), self.coupler), (pivot, self.rocker), -1e-9)
    }

    /// The pin at an angle of the rocker.
    fn pin(&self, turn: f64) -> Point {
        about([self.ground, 0.0], self.pin, turn)
    }

    pub(crate) fn robot(&self, random: &mut Random, kind: Kind) -> Outcome<Description> {
        let [a, b, c, d] =
            [[0.0; 2], self.tip(0.0), self.pin, [self.ground, 0.0]].map(|[x, y]| [x, y, 0.0]);
        let mut of = begun(random, kind);
        let crank = joint(&mut of, BASE, Turn, a, Z);
        let coupler = joint(&mut of, crank, Turn, b, Z);
        let rocker = joint(&mut of, BASE, Turn, d, Z);
        cut(&mut of, coupler, rocker, c, "xy");
        finish(of, &[crank], &[crank])
    }
}

/// A path of the pin in small steps that goes straight on.
struct Path {
    y: f64,
    pin: Point,
    before: Point,
    /// The pin of the other assembly.
    other: Point,
    step: f64,
}

impl Path {
    fn of(bars: &Bars) -> Path {
        Path { y: 0.0, pin: bars.pin, before: bars.pin, other: bars.pin, step: 0.0 }
    }

    /// On to a crank's angle; none if the loop does not close on the way.
    fn go(&mut self, bars: &Bars, to: f64) -> Option<()> {
        let n = ((to - self.y).abs() / FINE).ceil().max(1.0);
        let from = self.y;
        let step = (to - self.y) / n;
        for k in 1..=n as usize {
            let y = if k as f64 == n { to } else { from + step * k as f64 };
            let share = if self.step == 0.0 { 0.0 } else { step / self.step };
            let ahead: Point =
                std::array::from_fn(|i| self.pin[i] + share * (self.pin[i] - self.before[i]));
            let [a, b] = bars.pins(y)?;
            self.before = self.pin;
            (self.pin, self.other) =
                if distance(a, ahead) <= distance(b, ahead) { (a, b) } else { (b, a) };
            (self.y, self.step) = (y, step);
        }
        Some(())
    }

    /// The rocker's rate over the crank's, by the last difference.
    fn rate(&self, bars: &Bars) -> f64 {
        let heading = |p: Point| f64::atan2(p[1], p[0] - bars.ground);
        let turn = heading(self.pin) - heading(self.before);
        (turn - (turn / (2.0 * PI)).round() * 2.0 * PI) / self.step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_path_goes_straight_on_where_a_parallelogram_is_flat() {
        for direction in [1.0, -1.0] {
            let crank = 1.0;
            let ground = 2.0;
            let coupler = ground;
            let rocker = crank;
            let pin = [2.0, 1.0];
            let name = "parallelogram";
            let bars = Bars { name, crank, coupler, rocker, ground, zero: PI / 2.0, pin };
            let mut path = Path::of(&bars);
            for k in 1..20 {
                let y = 0.3 * direction * f64::from(k);
                path.go(&bars, y).expect("it closes all round");
                assert!(distance(path.pin, bars.pin(y)) < 1e-6, "{y}");
                assert!((path.rate(&bars) - 1.0).abs() < 1e-3, "{y}");
            }
        }
    }

    #[test]
    fn a_declared_parallelogram_goes_through_its_flat_poses() {
        let mut cases = Cases::default();
        (0..20).for_each(|seed| one(&mut cases, seed).expect("answers"));
        let chains = cases.all.iter().filter(|case| case.method == "PARALLELOGRAMCHAIN");
        assert!(chains.clone().count() >= 6);
        for case in chains {
            assert_eq!(case.assessment, Assessment::Held, "{case:?}");
        }
    }
}

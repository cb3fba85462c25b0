//! The small mechanisms of the stress cases, compiled with numerical closures, and random loops.

use sarrus_dynamics::description::{Description, SubmechanismKind::Numerical};
use sarrus_dynamics::{CompileError, Compiled, LinkId, Model};
use sarrus_report::{Outcome, robots::small};
use sarrus_tests::seed::Seeded;

use small::Turn;

fn compiled(of: Outcome<Description>) -> Compiled {
    Model::compile(&of.unwrap()).unwrap_or_else(|error| panic!("{error}"))
}

pub(super) fn four_bar(points: [[f64; 2]; 4], which: &str) -> Compiled {
    compiled(small::four_bar(points, Numerical, which))
}

pub(super) fn bricard(open: bool) -> Compiled {
    compiled(small::bricard(open))
}

pub(super) fn door(spin: bool) -> Compiled {
    compiled(small::door(spin))
}

pub(super) fn lambda() -> Compiled {
    compiled(small::lambda(Numerical))
}

/// The lambda with all lengths scaled.
pub(super) fn lambda_of_size(scale: f64) -> Compiled {
    let description = small::lambda(Numerical).unwrap();
    compiled(Ok(crate::scaling::scaled(&description, scale, 1.0)))
}

/// A random spatial chain of turning joints with one degree of freedom, closed by a cut with these
/// rows in skew axes.
pub(super) fn loop_in_space(
    seeded: &mut Seeded,
    joints: usize,
    which: &str,
    scale: f64,
) -> Result<Compiled, CompileError> {
    let mut of = small::mechanism(Numerical);
    let split = seeded.below(joints - 1) + 1;
    let mut links = Vec::new();
    let mut ends = [LinkId::BASE; 2];
    // half of the loops lie in one subtree, so that both ends move with its first joint
    let common = seeded.chance(0.5);
    for k in 0..joints {
        let side = usize::from(k >= split);
        let link =
            small::joint(&mut of, ends[side], Turn, seeded.vector(scale), seeded.direction());
        ends[side] = link;
        links.push(link);
        if k == 0 && common {
            ends = [link; 2];
            ends[0] = small::joint(&mut of, link, Turn, seeded.vector(scale), seeded.direction());
            links.push(ends[0]);
        }
    }
    let R = seeded.pose(0.0).R;
    let row = |c: char| -> [f64; 6] {
        let k = "abcxyz".find(c).unwrap();
        std::array::from_fn(|i| if i / 3 == k / 3 { R[i % 3][k % 3] } else { 0.0 })
    };
    let cut = of.cut("cut0", ends[0], ends[1]).at(seeded.vector(scale));
    which.chars().fold(cut, |cut, c| cut.row(c, row(c)));
    links.truncate(if common { 2 } else { 1 });
    of.independent(links.iter().copied()).active(links).compile()
}

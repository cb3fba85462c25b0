//! Mechanisms in code: every frame parallel to the root's at zero, so that a joint is a point, a
//! kind and an axis.

use sarrus_dynamics::description::{Inertial, JointKind, SubmechanismKind};
use sarrus_dynamics::{CompileError, Compiled, DescriptionBuilder, LinkId};
use sarrus_tests::seed::Seeded;

pub(super) const X: [f64; 3] = [1.0, 0.0, 0.0];
pub(super) const Y: [f64; 3] = [0.0, 1.0, 0.0];
pub(super) const Z: [f64; 3] = [0.0, 0.0, 1.0];
pub(super) use JointKind::{Prismatic as Slide, Revolute as Turn};

/// Rows along and about the axes of the root: `xyz` linear, `abc` angular.
pub(super) fn rows(which: &str) -> Vec<[f64; 6]> {
    which
        .chars()
        .map(|c| std::array::from_fn(|k| if "abcxyz".find(c) == Some(k) { 1.0 } else { 0.0 }))
        .collect()
}

/// A mechanism under way; link 0 is the base, link k + 1 is moved by joint k.
pub(super) struct Mechanism {
    robot: DescriptionBuilder,
    links: Vec<LinkId>,
}

impl Mechanism {
    pub(super) fn new() -> Mechanism {
        let mut robot = DescriptionBuilder::new("mechanism");
        let inertia = [0.2, 0.01, 0.02, 0.3, 0.0, 0.25];
        robot
            .gravity([0.3, -9.7, 1.1])
            .default_inertial(Inertial::new(1.0, [0.1, 0.2, -0.1], inertia))
            .submechanism("loop", SubmechanismKind::Numerical);
        Mechanism { robot, links: vec![LinkId::BASE] }
    }

    /// A joint at a point of the root; returns the link that it moves.
    pub(super) fn joint(
        &mut self,
        parent: usize,
        kind: JointKind,
        at: [f64; 3],
        axis: [f64; 3],
    ) -> usize {
        let child = self.links.len();
        let joint = self.robot.joint(format!("j{}", child - 1), kind, self.links[parent]);
        let joint = joint.limits(-9.0, 9.0).velocity_limit(9e9).effort_limit(9e9);
        let link = joint.at(at).axis(axis).link_name(format!("link{child}")).link();
        self.links.push(link);
        child
    }

    /// A cut at a point of the root, rows in its axes.
    pub(super) fn cut(
        &mut self,
        predecessor: usize,
        successor: usize,
        at: [f64; 3],
        rows: &[[f64; 6]],
    ) {
        let [predecessor, successor] = [predecessor, successor].map(|link| self.links[link]);
        let cut = self.robot.cut("cut0", predecessor, successor).at(at);
        rows.iter().enumerate().fold(cut, |cut, (k, row)| cut.row(format!("{k}"), *row));
    }

    /// With its independent and its active joints.
    pub(super) fn compile(
        mut self,
        independent: &[usize],
        active: &[usize],
    ) -> Result<Compiled, CompileError> {
        let of = |joints: &[usize]| joints.iter().map(|j| self.links[j + 1]).collect::<Vec<_>>();
        let (independent, active) = (of(independent), of(active));
        self.robot.independent(independent).active(active).compile()
    }
}

/// A four-bar A B C D in the plane x y; cut at C with the rows named, or as a chain of four joints
/// that is welded to the base.
pub(super) fn four_bar([a, b, c, d]: [[f64; 2]; 4], which: &str) -> Compiled {
    let at = |p: [f64; 2]| [p[0], p[1], 0.0];
    let mut of = Mechanism::new();
    let crank = of.joint(0, Turn, at(a), Z);
    let coupler = of.joint(crank, Turn, at(b), Z);
    if which.len() < 6 {
        let rocker = of.joint(0, Turn, at(d), Z);
        of.cut(coupler, rocker, at(c), &rows(which));
    } else {
        let rocker = of.joint(coupler, Turn, at(c), Z);
        let last = of.joint(rocker, Turn, at(d), Z);
        of.cut(0, last, [0.3, 0.1, 0.7], &rows(which));
    }
    of.compile(&[0], &[0]).unwrap_or_else(|error| panic!("{error}"))
}

/// Crank and rocker of four different lengths.
pub(super) const LOOSE: [[f64; 2]; 4] = [[0.0, 0.0], [0.2, 0.9], [1.4, 1.0], [2.1, -0.1]];

/// Bricard's linkage of a cube, cut by a weld or, `open`, at its last revolute.
pub(super) fn bricard(open: bool) -> Compiled {
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, -1.0, 1.0],
        [0.0, -1.0, 1.0],
        [0.0, 0.0, 1.0],
    ];
    let mut of = Mechanism::new();
    let mut link = 0;
    let count = if open { 5 } else { 6 };
    for (at, axis) in points.into_iter().zip([Y, Z, X, Y, Z, X]).take(count) {
        link = of.joint(link, Turn, at, axis);
    }
    of.cut(0, link, points[5], &rows(if open { "xyzbc" } else { "xyzabc" }));
    of.compile(&[0], &[0]).unwrap_or_else(|error| panic!("{error}"))
}

/// A door on a hinge, pushed by a rod between two ball joints: three turns, a slider, a ball.
pub(super) fn door(spin: bool) -> Compiled {
    let (foot, head) = ([-0.6, 0.3, 0.2], [1.1, 1.0, 0.5]);
    let along: [f64; 3] = std::array::from_fn(|k| head[k] - foot[k]);
    let mut of = Mechanism::new();
    let door = of.joint(0, Turn, [1.0, 0.0, 0.0], Z);
    let mut rod = of.joint(0, Turn, foot, Z);
    rod = of.joint(rod, Turn, foot, Y);
    if spin {
        rod = of.joint(rod, Turn, foot, along);
    }
    rod = of.joint(rod, Slide, foot, along);
    of.cut(door, rod, head, &rows("xyz"));
    of.compile(&[0], &[if spin { 4 } else { 3 }]).unwrap_or_else(|error| panic!("{error}"))
}

/// A rocker of 0.9 at the origin, a stator at (1, 0) whose slider passes 0.3 beside its pivot,
/// scaled.
pub(super) fn lambda(scale: f64) -> Compiled {
    let (arm, aside) = (0.9, 0.3);
    let heading = f64::atan2(arm, -1.0) - f64::asin(aside / f64::hypot(1.0, arm));
    let mut of = Mechanism::new();
    let rocker = of.joint(0, Turn, [0.0; 3], Z);
    let stator = of.joint(0, Turn, [scale, 0.0, 0.0], Z);
    let slider = of.joint(
        stator,
        Slide,
        [0.8 * scale, 0.1 * scale, 0.0],
        [heading.cos(), heading.sin(), 0.0],
    );
    of.cut(rocker, slider, [0.0, arm * scale, 0.0], &rows("xy"));
    of.compile(&[0], &[2]).unwrap_or_else(|error| panic!("{error}"))
}

/// A chain of turning joints somewhere in space, closed by a cut of these rows in skew axes, of one
/// freedom.
pub(super) fn loop_in_space(
    seeded: &mut Seeded,
    joints: usize,
    which: &str,
    scale: f64,
) -> Result<Compiled, CompileError> {
    let mut of = Mechanism::new();
    let split = seeded.below(joints - 1) + 1;
    let mut ends = [0, 0];
    // in one subtree half of the time, so that both ends move with the first joint
    let common = seeded.chance(0.5);
    for k in 0..joints {
        let side = usize::from(k >= split);
        let at = seeded.vector(scale);
        let axis = seeded.direction();
        if k == 0 && common {
            ends = [of.joint(0, Turn, at, axis); 2];
            ends = [of.joint(ends[0], Turn, seeded.vector(scale), seeded.direction()), ends[1]];
        } else {
            ends[side] = of.joint(ends[side], Turn, at, axis);
        }
    }
    let R = seeded.pose(0.0).R;
    let turned = rows(which).into_iter().map(|row| {
        let turn = |v: &[f64]| -> [f64; 3] {
            std::array::from_fn(|i| (0..3).map(|j| R[i][j] * v[j]).sum())
        };
        let (a, l) = (turn(&row[..3]), turn(&row[3..]));
        [a[0], a[1], a[2], l[0], l[1], l[2]]
    });
    of.cut(ends[0], ends[1], seeded.vector(scale), &turned.collect::<Vec<_>>());
    let independent: Vec<usize> = if common { vec![0, 1] } else { vec![0] };
    of.compile(&independent, &independent)
}

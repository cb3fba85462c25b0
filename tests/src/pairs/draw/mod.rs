//! Robots of features that meet: mechanisms of every kind, drawn on a base that may be far or
//! float, with springs, limits, couplings, redundant rows and units of any size.

mod whole;

use sarrus_dynamics::description::{
    Curve, Description, Inertial, JointKind, Placement, SubmechanismKind as Kind,
};
use sarrus_dynamics::{CutJoint, DescriptionBuilder, LinkId};

use super::oracle::Oracle;
use crate::rigid::{Pose, Vector, add, norm, unit};
use crate::seed::Seeded;
use whole::{lean, limits, on_base, resize, springs};

/// Which features a robot has; each is drawn in detail from the seed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Features {
    /// Angles of several turns.
    pub turns: bool,
    /// Limits of positions, velocities and efforts.
    pub limits: bool,
    /// Springs, dampers and rotors.
    pub springs: bool,
    /// A base far from the root.
    pub far: bool,
    /// Loops closed by Newton's method only.
    pub numerical: bool,
    /// A base that floats.
    pub floating: bool,
    /// Joints that follow others.
    pub mimic: bool,
    /// Joints that are locked.
    pub locks: bool,
    /// Rows that others imply, and rows of any length.
    pub redundant: bool,
    /// Lengths and masses of any size.
    pub sizes: bool,
    /// More or fewer actuators than independents, on any joints.
    pub actuators: bool,
    /// Ball joints in chains.
    pub balls: bool,
    /// Read from files in dialects.
    pub files: bool,
    /// Rows that lean against each other.
    pub oblique: bool,
    /// Joints that follow others by curves.
    pub curves: bool,
    /// Sums over the links and frames in every view are asked for too.
    pub sums: bool,
    /// Simulated, with springs between links and inputs, instead of asked.
    pub simulated: bool,
}

/// A drawn robot.
pub struct Drawn {
    /// Its mechanisms in words.
    pub name: String,
    /// The robot.
    pub description: Description,
    /// The same with other rows of the same cuts.
    pub oblique: Option<Description>,
    /// A typical length of it `[m]`.
    pub length: f64,
    /// Reach of each joint that may be independent.
    pub reach: Vec<f64>,
}

const X: Vector = [1.0, 0.0, 0.0];
const Y: Vector = [0.0, 1.0, 0.0];
const Z: Vector = [0.0, 0.0, 1.0];

/// The rows of these letters: `xyz` along and `abc` about the axes of the cut frame.
fn letters(which: &str) -> Vec<[f64; 6]> {
    let row = |c: char| std::array::from_fn(|k| f64::from("abcxyz".find(c) == Some(k)));
    which.chars().map(row).collect()
}

struct Pen {
    seeded: Seeded,
    with: Features,
    robot: DescriptionBuilder,
    names: Vec<&'static str>,
    reach: Vec<(usize, f64)>,
    count: usize,
    /// Links that carry further mechanisms.
    ends: Vec<LinkId>,
    /// Joints of one freedom in loops, which joints of chains may follow.
    leaders: Vec<LinkId>,
}

impl Pen {
    fn inertial(&mut self) -> Inertial {
        let s = &mut self.seeded;
        let mass = s.within(0.2, 2.0);
        let [a, b, c] = [(); 3].map(|()| mass * s.within(0.05, 0.3_f64).powi(2));
        let tilted = s.pose(0.0).R;
        let [x, y, z] = [b + c, a + c, a + b];
        let entry = |i: usize, j: usize| {
            tilted[i][0] * x * tilted[j][0]
                + tilted[i][1] * y * tilted[j][1]
                + tilted[i][2] * z * tilted[j][2]
        };
        let tensor = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        Inertial::new(mass, s.vector(0.3), tensor)
    }

    fn joint(&mut self, kind: JointKind, on: LinkId, at: Vector, axis: Vector) -> LinkId {
        let inertial = self.inertial();
        self.count += 1;
        let name = format!("j{}", self.count);
        let sign = self.seeded.sign();
        let axis = axis.map(|x| sign * x);
        self.robot.joint(name, kind, on).origin(at).axis(axis).inertial(inertial).link()
    }

    /// A frame anywhere on a link.
    fn frame(&mut self, on: LinkId) -> LinkId {
        self.count += 1;
        let at = self.seeded.pose(1.0);
        let made = self.robot.fixed(format!("f{}", self.count), on).origin(at.p).rpy(at.rpy());
        made.link()
    }

    fn begin(&mut self, kind: Kind) {
        self.count += 1;
        let name = format!("part{}", self.count);
        self.robot.submechanism(name, kind);
    }

    fn cut(&mut self, ends: [LinkId; 2], on: [Placement; 2], rows: &[[f64; 6]], universal: bool) {
        self.count += 1;
        let name = format!("cut{}", self.count);
        let mut cut = self.robot.cut(name, ends[0], ends[1]).placements(on[0], on[1]);
        for (k, row) in rows.iter().enumerate() {
            cut = cut.row(format!("r{k}"), *row);
        }
        if universal {
            cut.joint(CutJoint::Universal { axis: Z, axis2: X });
        }
    }

    /// Rows of a cut with others that they imply, and of any length.
    fn rows(&mut self, which: &str) -> Vec<[f64; 6]> {
        let mut rows = letters(which);
        if self.with.redundant {
            for _ in 0..self.seeded.below(3) {
                // a combination of rows of one kind
                let linear = self.seeded.chance(0.5);
                let of: Vec<[f64; 6]> = rows
                    .iter()
                    .filter(|row| row[..3].iter().all(|x| *x == 0.0) == linear)
                    .copied()
                    .collect();
                if of.is_empty() {
                    continue;
                }
                let mut sum = [0.0; 6];
                for row in &of {
                    let by = self.seeded.within(-1.0, 1.0);
                    (0..6).for_each(|k| sum[k] += by * row[k]);
                }
                if sum.iter().any(|x| x.abs() > 0.1) && rows.len() < 6 {
                    rows.push(sum);
                }
            }
            for row in &mut rows {
                if self.seeded.chance(0.3) {
                    let by = 10f64.powf(self.seeded.within(-3.0, 3.0)) * self.seeded.sign();
                    *row = row.map(|x| by * x);
                }
            }
            let order = self.seeded.order(rows.len());
            rows = order.into_iter().map(|k| rows[k]).collect();
        }
        rows
    }

    /// A planar loop through four points, in the frame of a link.
    fn planar(&mut self, on: LinkId) {
        let s = &mut self.seeded;
        let crank = s.within(0.2, 0.4);
        let angle = s.within(-3.0, 3.0);
        let ground = s.within(0.9, 1.1);
        let coupler = s.within(0.8, 1.2);
        let rocker = s.within(0.7, 1.1);
        let tip = [crank * f64::cos(angle), crank * f64::sin(angle), 0.0];
        let far = [ground, 0.0, 0.0];
        let span = add(far, -1.0, tip);
        let d = norm(span);
        let along = (d * d + coupler * coupler - rocker * rocker) / (2.0 * d);
        let height = (coupler * coupler - along * along).max(0.0).sqrt() * s.sign();
        let pin = add(add(tip, along / d, span), height / d, [-span[1], span[0], 0.0]);
        let lift = [(); 3].map(|()| if s.chance(0.5) { 0.0 } else { s.within(-0.2, 0.2) });
        let slides = s.chance(0.3);
        let numerical = self.with.numerical || s.chance(0.4);
        let which = ["xy", "xy", "xyz", "xyzab"][if numerical { s.below(4) } else { 0 }];
        let kind = match (numerical, slides) {
            (true, _) => Kind::Numerical,
            (_, false) => Kind::FourBar,
            (_, true) => Kind::SliderCrank,
        };
        self.begin(kind);
        let [tip, pin, far] = [[tip, pin, far], [[0.0; 3]; 3]][0];
        let first = self.joint(JointKind::Revolute, on, [0.0, 0.0, lift[0]], Z);
        let second = self.joint(JointKind::Revolute, first, add(tip, lift[1], Z), Z);
        let at_second = add(tip, lift[0] + lift[1], Z);
        let (third, at_third) = if slides {
            let way = unit([1.0, self.seeded.within(-0.3, 0.3), 0.0]);
            let at = [pin[0], pin[1], lift[2]];
            (self.joint(JointKind::Prismatic, on, at, way), at)
        } else {
            let at = add(far, lift[2], Z);
            (self.joint(JointKind::Revolute, on, at, Z), at)
        };
        let rows = self.rows(which);
        let place = |from: Vector| Placement { xyz: add(pin, -1.0, from), rpy: [0.0; 3] };
        let ends = [(second, place(at_second)), (third, place(at_third))];
        let [p, q] = if self.seeded.chance(0.5) { ends } else { [ends[1], ends[0]] };
        self.cut([p.0, q.0], [p.1, q.1], &rows, false);
        self.names.push(if slides { "slider-crank" } else { "four-bar" });
        let independent = if self.with.turns || self.seeded.chance(0.6) {
            first
        } else if slides && self.seeded.chance(0.5) {
            second
        } else {
            third
        };
        self.roles(&[independent], &[first, second, third]);
        let reach = if independent == first { 2.0 } else { 0.2 };
        self.reach.push((independent.index(), reach));
        self.ends.push([first, second, third][self.seeded.below(3)]);
    }

    /// A lambda.
    fn lambda(&mut self, on: LinkId) {
        let s = &mut self.seeded;
        let base = s.within(0.5, 1.0);
        let arm = base * if s.chance(0.7) { s.within(0.3, 0.6) } else { s.within(2.0, 2.5) };
        let angle = s.sign() * s.within(1.1, 2.0);
        let pin = [arm * f64::cos(angle), arm * f64::sin(angle), 0.0];
        let span = add(pin, -1.0, [base, 0.0, 0.0]);
        let tilt = if s.chance(0.5) { 0.0 } else { s.within(-0.2, 0.2) };
        let (sine, cosine) = f64::sin_cos(tilt);
        let way = unit([cosine * span[0] - sine * span[1], sine * span[0] + cosine * span[1], 0.0]);
        let numerical = self.with.numerical || s.chance(0.4);
        let which = if numerical { ["xy", "xyz", "xyzab"][s.below(3)] } else { "xy" };
        self.begin(if numerical { Kind::Numerical } else { Kind::Rrpr });
        let rocker = self.joint(JointKind::Revolute, on, [0.0; 3], Z);
        let stator = self.joint(JointKind::Revolute, on, [base, 0.0, 0.0], Z);
        let slider = self.joint(JointKind::Prismatic, stator, span, way);
        let rows = self.rows(which);
        let at = |xyz: Vector| Placement { xyz, rpy: [0.0; 3] };
        let ends = [(rocker, at(pin)), (slider, at([0.0; 3]))];
        let [p, q] = if self.seeded.chance(0.5) { ends } else { [ends[1], ends[0]] };
        self.cut([p.0, q.0], [p.1, q.1], &rows, false);
        self.names.push("lambda");
        let slides = self.seeded.chance(0.3);
        let independent = if slides { slider } else { rocker };
        self.roles(&[independent], &[rocker, stator, slider]);
        self.reach.push((independent.index(), if slides { 0.1 } else { 0.5 }));
        self.ends.push([rocker, slider][self.seeded.below(2)]);
    }

    /// A loop in space: joints anywhere, closed by any cut; and a second loop over it.
    fn spatial(&mut self, on: LinkId) {
        let types =
            ["xyz", "xyzab", "xyzabc", "xyab", "xyabc", "ab", "abc", "xy", "xyz", "xyzab", "xyzu"];
        let which = types[self.seeded.below(types.len())];
        let free = 1 + usize::from(self.seeded.chance(0.3));
        let mut n = which.len() + free;
        // a ball joint counts three
        let ball = self.with.balls && n > 4 && self.seeded.chance(0.4);
        n -= if ball { 2 } else { 0 };
        let has_ball = ball;
        let ball = if ball { self.seeded.below(n) } else { n };
        self.begin(Kind::Numerical);
        let mut ends = [on; 2];
        let mut at = [Pose::IDENTITY; 2];
        let mut joints = Vec::new();
        let first_side = 1 + self.seeded.below(n);
        for k in 0..n {
            let side = usize::from(k >= first_side);
            let turns = self.seeded.chance(0.8) || which == "ab" || which == "abc";
            let kind = match (k == ball, turns) {
                (true, _) => JointKind::Spherical,
                (_, true) => JointKind::Revolute,
                _ => JointKind::Prismatic,
            };
            let axis = if self.seeded.chance(0.3) {
                [X, Y, Z][self.seeded.below(3)]
            } else {
                self.seeded.direction()
            };
            let origin = self.seeded.vector(0.7);
            at[side] = at[side].then(&Pose { p: origin, ..Pose::IDENTITY });
            ends[side] = self.joint(kind, ends[side], origin, axis);
            if k != ball {
                joints.push(ends[side]);
            }
        }
        let n = joints.len();
        let universal = which.ends_with('u');
        let rows = if universal { Vec::new() } else { self.rows(which) };
        let frame = Pose { p: self.seeded.vector(0.7), ..self.seeded.pose(0.0) };
        let on_both = at.map(|at| {
            let x = at.inverse().then(&frame);
            Placement { xyz: x.p, rpy: x.rpy() }
        });
        self.cut(ends, on_both, &rows, universal);
        self.names.push(if has_ball { "loop in space with a ball" } else { "loop in space" });
        let order = self.seeded.order(n);
        let independent: Vec<LinkId> = order[..free].iter().map(|k| joints[*k]).collect();
        self.roles(&independent, &joints);
        for link in &independent {
            self.reach.push((link.index(), 0.25));
        }
        self.ends.push(joints[self.seeded.below(n)]);
    }

    /// Two four-bars that share a link, a five-bar, or a five-bar with gears.
    fn two_planar(&mut self, on: LinkId) {
        self.begin(Kind::Numerical);
        let s = &mut self.seeded;
        let jitter = |s: &mut Seeded, p: [f64; 2]| {
            [p[0] + s.within(-0.1, 0.1), p[1] + s.within(-0.1, 0.1), 0.0]
        };
        let five = s.chance(0.5);
        let gear = five && (self.with.mimic || s.chance(0.3));
        let a = jitter(s, [0.0, 0.0]);
        let b = jitter(s, [-0.2, 0.6]);
        let c = jitter(s, [0.5, 1.2]);
        let d = jitter(s, [1.2, 0.7]);
        let e = jitter(s, [1.0, 0.0]);
        let turn = |pen: &mut Pen, on, from: Vector, to: Vector| {
            pen.joint(JointKind::Revolute, on, add(to, -1.0, from), Z)
        };
        let place =
            |from: Vector, at: Vector| Placement { xyz: add(at, -1.0, from), rpy: [0.0; 3] };
        if five {
            let left = turn(self, on, [0.0; 3], a);
            let upper = turn(self, left, a, b);
            let right = turn(self, on, [0.0; 3], e);
            let last = turn(self, right, e, d);
            let which = ["xy", "xyz", "xyzab"][self.seeded.below(3)];
            let rows = self.rows(which);
            self.cut([upper, last], [place(b, c), place(d, c)], &rows, false);
            if gear {
                let ratio = self.seeded.within(0.3, 2.0) * self.seeded.sign();
                self.robot.couple(right, [(left, ratio)], 0.0);
                self.roles(&[left], &[left, upper, right, last]);
                self.names.push("geared five-bar");
            } else {
                self.roles(&[left, right], &[left, upper, right, last]);
                self.reach.push((right.index(), 0.3));
                self.names.push("five-bar");
            }
            self.reach.push((left.index(), 0.3));
            self.ends.push(upper);
        } else {
            let crank = turn(self, on, [0.0; 3], a);
            let coupler = turn(self, crank, a, b);
            let rocker = turn(self, on, [0.0; 3], e);
            let g = jitter(&mut self.seeded, [2.0, 0.9]);
            let h = jitter(&mut self.seeded, [2.2, 0.1]);
            let second = turn(self, rocker, e, d);
            let third = turn(self, on, [0.0; 3], h);
            let which = ["xy", "xyz", "xyzab"][self.seeded.below(3)];
            let rows = self.rows(which);
            self.cut([coupler, rocker], [place(b, c), place(e, c)], &rows, false);
            let rows = self.rows(which);
            self.cut([second, third], [place(d, g), place(h, g)], &rows, false);
            let joints = [crank, coupler, rocker, second, third];
            let one = joints[[0, 2, 4][self.seeded.below(3)]];
            self.roles(&[one], &joints);
            self.reach.push((crank.index(), 0.25));
            self.reach.push((rocker.index(), 0.25));
            self.reach.push((third.index(), 0.25));
            self.names.push("two four-bars");
            self.ends.push(joints[self.seeded.below(5)]);
        }
    }

    /// A chain of free joints, of which some follow others.
    fn chain(&mut self, on: LinkId) {
        let n = 1 + self.seeded.below(3) + usize::from(self.with.mimic);
        self.begin(if self.with.mimic { Kind::Transmission } else { Kind::Serial });
        let mut link = on;
        let mut free: Vec<LinkId> = Vec::new();
        let mut all = Vec::new();
        for _ in 0..n {
            let ball = self.with.balls && self.seeded.chance(0.2);
            let kind = match (ball, self.seeded.chance(0.75)) {
                (true, _) => JointKind::Spherical,
                (_, true) => JointKind::Revolute,
                _ => JointKind::Prismatic,
            };
            let at = self.seeded.vector(0.6);
            let axis = self.seeded.direction();
            link = self.joint(kind, link, at, axis);
            let mut masters: Vec<LinkId> = all.clone();
            let mut offset = self.seeded.within(-0.5, 0.5);
            if self.seeded.chance(0.3) && !self.leaders.is_empty() {
                // couplings that loops take part in hold at the zero pose
                (masters, offset) = (self.leaders.clone(), 0.0);
            }
            if self.with.mimic && !ball && !masters.is_empty() && self.seeded.chance(0.6) {
                let ratio = self.ratio();
                let master = masters[self.seeded.below(masters.len())];
                let mut terms = vec![(master, ratio)];
                if masters.len() > 1 && self.seeded.chance(0.3) {
                    let other = masters[self.seeded.below(masters.len())];
                    if other != master {
                        terms.push((other, self.seeded.within(-2.0, 2.0)));
                    }
                }
                if self.with.curves && self.seeded.chance(0.7) {
                    let through_zero = offset == 0.0;
                    let curve = self.curve(through_zero);
                    self.robot.couple_by(link, master, curve);
                    terms.retain(|(other, _)| *other != master);
                }
                if !terms.is_empty() {
                    self.robot.couple(link, terms, offset);
                }
            } else {
                free.push(link);
                self.reach.push((link.index(), 2.0));
            }
            if !ball {
                all.push(link);
            }
        }
        self.names.push("chain");
        if self.with.mimic {
            self.robot.independent(free.clone());
        }
        if self.with.actuators && self.seeded.chance(0.5) {
            let n = self.seeded.below(all.len() + 1);
            let order = self.seeded.order(all.len());
            self.robot.active(order[..n].iter().map(|k| all[*k]));
        }
        self.ends.push(link);
    }

    /// A polynomial or a table; `through_zero`: f(0) = 0.
    fn curve(&mut self, through_zero: bool) -> Curve {
        let s = &mut self.seeded;
        if s.chance(0.5) {
            let n = 2 + s.below(5);
            // curves of curves stay within a few turns
            let coefficient = |k: i32| s.within(-0.7, 0.7) * 0.25_f64.powi(k);
            let mut coefficients: Vec<f64> = (0..n as i32).map(coefficient).collect();
            let about = if through_zero { 0.0 } else { s.within(-0.5, 0.5) };
            if through_zero {
                coefficients[0] = 0.0;
            }
            return Curve::Polynomial { about, coefficients };
        }
        let n = 1 + s.below(4);
        let slope = s.within(-0.5, 0.5);
        let point = |k: i32, s: &mut Seeded| {
            let x = 0.4 * f64::from(k) + s.within(-0.1, 0.1);
            [x, slope * x + s.within(-0.05, 0.05)]
        };
        let mut points: Vec<[f64; 2]> = (-(n as i32)..=n as i32).map(|k| point(k, s)).collect();
        if through_zero {
            points[n] = [0.0; 2];
        }
        Curve::Table(points)
    }

    fn ratio(&mut self) -> f64 {
        let size = if self.with.sizes {
            self.seeded.within(-4.0, 4.0)
        } else {
            self.seeded.within(-1.0, 1.0)
        };
        10f64.powf(size) * self.seeded.sign()
    }

    fn roles(&mut self, independent: &[LinkId], all: &[LinkId]) {
        self.leaders.extend(all);
        self.robot.independent(independent.iter().copied());
        let mut active = independent.to_vec();
        if self.with.actuators || self.seeded.chance(0.3) {
            let order = self.seeded.order(all.len());
            let n = if self.with.actuators {
                self.seeded.below(3).min(all.len())
            } else {
                active.len()
            };
            active = order[..n].iter().map(|k| all[*k]).collect();
        }
        self.robot.active(active);
    }
}

/// Draws a robot of these features; none if its builder refuses it.
pub fn draw(with: Features, seeded: Seeded) -> Option<Drawn> {
    let robot = DescriptionBuilder::new("drawn");
    let mut pen = Pen {
        seeded,
        with,
        robot,
        names: Vec::new(),
        reach: Vec::new(),
        count: 0,
        ends: vec![LinkId::BASE],
        leaders: Vec::new(),
    };
    let n = 1 + pen.seeded.below(2) + usize::from(pen.seeded.chance(0.2));
    let gravity = pen.seeded.vector(10.0);
    pen.robot.gravity(gravity);
    for k in 0..n {
        let on = *pen.ends.last().unwrap_or(&LinkId::BASE);
        let on = if k > 0 && pen.seeded.chance(0.2) { LinkId::BASE } else { on };
        let frame = pen.frame(on);
        match pen.seeded.below(10) {
            0 | 1 => pen.planar(frame),
            2 if with.mimic => pen.chain(frame),
            2 => pen.planar(frame),
            3 => pen.lambda(frame),
            4..7 => pen.spatial(frame),
            7 | 8 => pen.two_planar(frame),
            _ => pen.chain(frame),
        }
    }
    let Pen { mut seeded, robot, names, reach: of_links, .. } = pen;
    let mut description = robot.build().ok()?;
    let mut reach = vec![0.2; description.joints.len()];
    of_links.iter().for_each(|(link, x)| reach[link - 1] = *x);
    let mut length = 1.0;
    if with.sizes {
        length = 10f64.powf(seeded.within(-4.0, 4.0));
        let mass = 10f64.powf(seeded.within(-6.0, 6.0));
        resize(&mut description, length, mass);
    }
    if with.springs {
        springs(&mut description, &mut seeded, length);
    }
    if with.limits {
        limits(&mut description, &mut seeded, length);
    }
    let mut name = names.join(", ");
    if with.floating {
        on_base(&mut description, JointKind::Floating, &mut seeded, 0.5 * length);
        reach.push(length);
        name += ", floating";
    }
    if with.far {
        let size = length * 10f64.powf(seeded.within(1.0, 7.0));
        on_base(&mut description, JointKind::Fixed, &mut seeded, size);
        reach.push(0.0);
        name += &format!(", {size:.0e} m away");
    }
    let oblique = with.oblique.then(|| lean(&description, &mut seeded));
    Some(Drawn { name, description, oblique, length, reach })
}

/// The least pivot of the loops at the zero pose with these independents.
pub fn pivot_at_zero(of: &Drawn, independent: &[usize]) -> f64 {
    let oracle = Oracle::new(&of.description, independent, &[], of.length);
    let n = oracle.independents().len();
    oracle.rates(&oracle.zero::<f64>(), &vec![0.0; n]).pivot
}

//! Mechanisms whose lengths one edits: the robot by its lengths, and its page.

use std::f64::consts::{FRAC_PI_2, PI};

use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind};
use sarrus_dynamics::{
    Compiled, CutJoint, DescriptionBuilder, Field, FieldSet, LinkId, Model, OpenModel, Plan,
    Planned, Query, Request, Status,
};
use sarrus_generate::{GenerateError, Kernel, Lengths, RandomInputs, Script};
use serde_json::{Value, json};

use crate::{ShowError, embedded, filled, picture, traced};

/// Change of a length by which its points are found `[m]`.
const STEP: f64 = 1.0 / 64.0;
/// Poses at other lengths that a page compares.
const CHECKS: u64 = 40;

/// A mechanism of a few lengths.
#[derive(Clone, Copy, Debug)]
pub struct Mechanism {
    /// Its name, that of its page too.
    pub name: &'static str,
    /// One line about it.
    pub about: &'static str,
    lengths: &'static [Length],
    /// Greatest value of each y to both sides.
    reach: f64,
    /// Bars between links, with their colours, for the drawing.
    bars: &'static [(&'static str, &'static str, &'static str)],
    /// Links at whose origins loops are cut, and joints whose axes are drawn.
    pins: &'static [&'static str],
    build: fn(&[f64]) -> (DescriptionBuilder, Vec<f64>),
}

#[derive(Debug)]
struct Length {
    name: &'static str,
    value: f64,
    range: [f64; 2],
}

/// The mechanisms with pages.
pub const MECHANISMS: [Mechanism; 2] = [
    Mechanism {
        name: "lambda_lengths",
        about: "the lambda elbow with editable lengths: γ, G and where it loses its motor",
        lengths: &[
            Length { name: "rocker", value: 0.18, range: [0.05, 0.3] },
            Length { name: "pin beside the rocker", value: 0.0, range: [-0.1, 0.1] },
            Length { name: "base", value: 0.11, range: [0.05, 0.3] },
            Length { name: "offset of the rod", value: 0.0, range: [-0.04, 0.04] },
        ],
        reach: PI,
        bars: &[
            ("base", "stator_link", "grid"),
            ("base", "pin_link", "rod"),
            ("stator_link", "motor_link", "slide"),
            ("motor_link", "end_link", "slide"),
        ],
        pins: &["pin_link"],
        build: lambda,
    },
    Mechanism {
        name: "ankle_lengths",
        about: "a 2SPU+1U ankle with editable lengths: γ, G and where it loses its motors",
        lengths: &[
            Length { name: "lever", value: 0.05, range: [0.01, 0.1] },
            Length { name: "half width at the foot", value: 0.04, range: [0.005, 0.1] },
            Length { name: "half width at the shank", value: 0.04, range: [0.005, 0.1] },
            Length { name: "height", value: 0.22, range: [0.12, 0.35] },
        ],
        reach: FRAC_PI_2,
        bars: &[
            ("base", "shank_link", "grid"),
            ("shank_link", "left_x_link", "grid"),
            ("shank_link", "right_x_link", "grid"),
            ("left_x_link", "left_motor_link", "slide"),
            ("right_x_link", "right_motor_link", "slide"),
            ("roll_link", "left_pin_link", "rod"),
            ("roll_link", "right_pin_link", "rod"),
            ("roll_link", "toe_link", "rod"),
        ],
        pins: &["left_pin_link", "right_pin_link"],
        build: ankle,
    },
];

/// A rocker about y that a slider on a turning stator moves, and a pose near its zero pose; u is
/// the distance from the stator to the foot of the rod.
fn lambda(lengths: &[f64]) -> (DescriptionBuilder, Vec<f64>) {
    let [rocker, beside, base, offset] = std::array::from_fn(|k| lengths[k]);
    let axis = [0.0, 1.0, 0.0];
    let mut robot = DescriptionBuilder::new("lambda_lengths");
    robot.default_inertial(Inertial::sphere(1.0, [0.0; 3], 0.03));
    robot.submechanism("lambda", SubmechanismKind::Numerical);
    let elbow = robot.revolute("elbow", LinkId::BASE, axis).link();
    let stator = robot.revolute("stator", LinkId::BASE, axis).origin([base, 0.0, 0.0]).link();
    let motor = robot.prismatic("motor", stator, [-1.0, 0.0, 0.0]).link();
    let pin = robot.fixed("pin", elbow).origin([beside, 0.0, rocker]).link();
    let end = robot.fixed("end", motor).origin([0.0, 0.0, offset]).link();
    let cut = robot.cut("pin", pin, end).placements(Default::default(), Default::default());
    cut.joint(CutJoint::PlanarRevolute { axis });
    robot.independent([elbow]).active([motor]);
    let reach = base - beside;
    (robot, vec![0.0, rocker.atan2(reach), rocker.hypot(reach)])
}

/// A universal joint, pitch and roll, and two struts; u is the length of each. The struts hang from
/// a shank, behind the joint.
fn ankle(lengths: &[f64]) -> (DescriptionBuilder, Vec<f64>) {
    let [lever, foot, shank, height] = std::array::from_fn(|k| lengths[k]);
    let [x, y] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut robot = DescriptionBuilder::new("ankle_lengths");
    robot.default_inertial(Inertial::sphere(1.0, [0.0; 3], 0.03));
    robot.submechanism("ankle", SubmechanismKind::Numerical);
    let pitch = robot.revolute("pitch", LinkId::BASE, y).link();
    let roll = robot.revolute("roll", pitch, x).link();
    robot.fixed("toe", roll).origin([0.12, 0.0, 0.0]);
    robot.fixed("shank", LinkId::BASE).origin([0.0, 0.0, height]);
    let mut motors = Vec::new();
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let at = [-0.05, sign * shank, height];
        let first = robot.revolute(format!("{side}_x"), LinkId::BASE, x).origin(at).link();
        let second = robot.revolute(format!("{side}_y"), first, y).link();
        let motor = robot.prismatic(format!("{side}_motor"), second, [0.0, 0.0, -1.0]).link();
        let pin = robot.fixed(format!("{side}_pin"), roll).origin([-lever, sign * foot, 0.0]);
        let pin = pin.link();
        let cut = robot.cut(format!("{side}_pin"), pin, motor);
        cut.placements(Default::default(), Default::default()).joint(CutJoint::Spherical);
        motors.push(motor);
    }
    robot.independent([pitch, roll]).active(motors);
    (robot, vec![0.0, 0.0, 0.0, 0.0, height, 0.0, 0.0, height])
}

impl Mechanism {
    /// The lengths of the page as it opens `[m]`.
    pub fn lengths(&self) -> Vec<f64> {
        self.lengths.iter().map(|length| length.value).collect()
    }

    /// The robot with these lengths: its loops are closed by Newton's method, and its coordinates
    /// are zero where those of all its lengths are. Allocates.
    ///
    /// # Errors
    /// [`ShowError::Lengths`]: it cannot be assembled at y = 0.
    pub fn compile(&self, lengths: &[f64]) -> Result<Compiled, ShowError> {
        self.compiled(lengths).map(|(_, compiled)| compiled)
    }

    fn compiled(&self, lengths: &[f64]) -> Result<(Description, Compiled), ShowError> {
        let (robot, near) = (self.build)(lengths);
        let failed = |error: String| ShowError::Lengths { mechanism: self.name, error };
        let mut description = robot.build().map_err(|error| failed(error.to_string()))?;
        let open = OpenModel::compile(&description).map_err(|error| failed(error.to_string()))?;
        let y = |joint: &usize| description.submechanisms[0].independent.contains(joint);
        let joints = description.submechanisms[0].spanning_tree.clone();
        let weights: Vec<f64> =
            joints.iter().map(|joint| if y(joint) { f64::INFINITY } else { 1.0 }).collect();
        let found = open.assemble(&near, &weights).map_err(|error| failed(error.to_string()))?;
        description.zero_pose = joints.into_iter().zip(found.q.iter().map(|x| vec![*x])).collect();
        description.submechanisms[0].closed_forms = false;
        let compiled = Model::compile(&description).map_err(|error| failed(error.to_string()))?;
        Ok((description, compiled))
    }

    /// The mechanism at its zero pose: [`crate::picture`]. Allocates.
    pub fn picture(&self) -> Option<String> {
        let (description, compiled) = self.compiled(&self.lengths()).ok()?;
        picture(&description, &compiled.model)
    }

    /// The page of the mechanism, with its lengths as inputs of generated code. Allocates.
    ///
    /// # Errors
    /// [`ShowError`].
    pub fn page(&self) -> Result<String, ShowError> {
        let (description, compiled) = self.compiled(&self.lengths())?;
        let frames: Vec<&str> = description.links.iter().map(|link| link.name.as_str()).collect();
        let script = traced(|| self.script(&compiled.model, &frames))?;
        let scripts = [
            include_str!("../page/three/three.min.js"),
            include_str!("../page/uplot/uPlot.iife.min.js"),
            &format!("{}pose.states = [{}];", script.function, script.states.join(",\n")),
            &format!("const robot = {};", embedded(&self.scene(&compiled.model, &frames)?)),
            include_str!("../page/geometry.js"),
            include_str!("../page/view.js"),
            include_str!("../page/lengths.js"),
        ];
        let template = include_str!("../page/lengths.html")
            .replace("@UPLOT@", include_str!("../page/uplot/uPlot.min.css"));
        Ok(filled(&template, self.name, &scripts))
    }

    /// γ, G and the poses of links.
    fn script(&self, model: &Model<f64>, frames: &[&str]) -> Result<Script, ShowError> {
        let lengths = self.lengths();
        let longer = |k: usize, steps: f64| {
            let mut other = lengths.clone();
            other[k] += steps * STEP;
            self.compile(&other).map(|compiled| compiled.model)
        };
        let longer = (0..lengths.len())
            .map(|k| Ok([longer(k, 1.0)?, longer(k, 2.0)?]))
            .collect::<Result<Vec<_>, ShowError>>()?;
        let named = self.lengths.iter().zip(&longer);
        let named = named.map(|(length, [once, twice])| (length.name, length.value, [once, twice]));
        let lengths = Lengths::new(model, named, STEP)?;
        let plan = plan(model, frames)?;
        let kernel = Kernel::trace_with_lengths(model, &plan, &lengths)?;
        Ok(Script::new(&kernel, model, "pose"))
    }

    fn scene(&self, model: &Model<f64>, frames: &[&str]) -> Result<String, ShowError> {
        let info = model.info();
        let place = |name: &str| frames.iter().position(|frame| *frame == name);
        let origin = [0.0; 3];
        let rods = self.bars.iter().filter_map(|(from, to, kind)| {
            Some(json!([place(from)?, origin, place(to)?, origin, kind]))
        });
        let marks = self.pins.iter().filter_map(|pin| Some(json!([place(pin)?, origin, pin])));
        let lengths = self.lengths.iter().map(|of| {
            json!({"name": of.name, "value": of.value, "lower": of.range[0], "upper": of.range[1]})
        });
        Ok(json!({
            "name": self.about,
            "links": [], "loops": [], "visuals": [], "meshes": [], "tips": [],
            "rods": rods.collect::<Vec<_>>(),
            "marks": marks.collect::<Vec<_>>(),
            "lengths": lengths.collect::<Vec<_>>(),
            "y": info.independent, "u": info.active, "q": info.tree,
            "reach": self.reach,
            "zero": model.tree_zero(),
            "checks": self.checks()?,
            "version": env!("CARGO_PKG_VERSION"),
        })
        .to_string())
    }

    /// Answers of the plans of robots with other lengths.
    fn checks(&self) -> Result<Vec<Value>, ShowError> {
        let mut found = Vec::new();
        for k in 0..CHECKS {
            let part = |i: usize| {
                let x = ((k + 1) as f64 * (0.618_034 + 0.137 * i as f64)).fract();
                let [lower, upper] = self.lengths[i].range;
                lower + (upper - lower) * x
            };
            let lengths: Vec<f64> = (0..self.lengths.len()).map(part).collect();
            let Ok(Compiled { model, .. }) = self.compile(&lengths) else { continue };
            let mut planned = Planned::of(&model, plan(&model, &[])?);
            planned.input = RandomInputs::new(&model, &planned.plan).input(k);
            if planned.run(&model).status == Status::Ok {
                let y = &planned.input[..model.info().independent_q.len()];
                let [q, jacobian] = [Field::Q, Field::G].map(|field| planned.get(field));
                found.push(json!({"lengths": lengths, "y": y, "q": q, "G": jacobian}));
            }
        }
        Ok(found)
    }
}

/// γ and G at y, from the zero pose.
fn plan(model: &Model<f64>, frames: &[&str]) -> Result<Plan, ShowError> {
    let links = &model.info().links;
    let named = |name: &&str| links.iter().position(|link| link == name).map(|link| link as u16);
    let frames: Vec<u16> = frames.iter().filter_map(named).collect();
    let pose =
        if frames.is_empty() { FieldSet::of(&[]) } else { FieldSet::of(&[Field::FramePose]) };
    let want = FieldSet::of(&[Field::Q, Field::U, Field::G, Field::GU]) | pose;
    let given = FieldSet::of(&[Field::Y, Field::QGuess]);
    let query = Query::new(Request::Kinematics, given, want).with_frames(&frames);
    Ok(Plan::new(model, &query).map_err(GenerateError::from)?)
}

//! A robot and its states in the format of the peers' programs: see the head of
//! `benches/peers/peer.hpp`.

use core::fmt::Display;

use sarrus_dynamics::description::{Cut, Description, JointKind, Loop, Placement, Row, Terms};
use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, Request, Status, loops_of};

use crate::robots::{Robot, packed};

/// The whole input, or the property of the robot that the programs do not support. Guesses and
/// closed poses are those of the variant at `place`.
pub(super) fn input(robot: &Robot, place: usize, seconds: f64) -> Result<String, String> {
    let Robot { description, states, .. } = robot;
    let model = &robot.variants.get(place).ok_or("it has no such variant")?.compiled.model;
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::QGuess]);
    let closed = Query::new(Request::Kinematics, given, FieldSet::of(&[Field::Q, Field::Qd]));
    let mut closed = Planned::new(model, &closed).map_err(|error| error.to_string())?;
    let mut text = Text(format!("seconds {seconds}\n"));
    text.numbers("gravity", &description.gravity);

    text.links(description);
    text.joints(description, model)?;
    text.groups(description);
    text.loops(description, model)?;
    text.couplings(description)?;
    text.line("states", [states.len()]);
    for state in states {
        closed.input = packed(&closed.plan, state, place);
        let answer = closed.run(model);
        if answer.status != Status::Ok {
            return Err(format!("a state is {}", answer.status));
        }
        let guess = &state.guesses[place];
        for numbers in [&state.y, &state.yd, &state.ydd, &state.tau_u, guess, &closed.output] {
            text.numbers("", numbers);
        }
    }
    Ok(text.0)
}

/// Words and numbers; each method ends a line. Numbers keep their bits when read back.
struct Text(String);

impl Text {
    fn links(&mut self, description: &Description) {
        self.line("links", [description.links.len()]);
        for link in &description.links {
            let inertial = link
                .inertial
                .as_ref()
                .map_or((0.0, Placement::default(), [0.0; 6]), |i| (i.mass, i.origin, i.inertia));
            self.numbers("", &[inertial.0]);
            self.placement(&inertial.1);
            self.numbers("", &inertial.2);
        }
    }

    fn joints(&mut self, description: &Description, model: &Model) -> Result<(), String> {
        self.line("joints", [description.joints.len()]);
        let closures = model.closures();
        for joint in &description.joints {
            let is_idle = closures.iter().any(|of| of.idle.contains(&joint.name));
            let kind = match joint.kind {
                _ if is_idle => "I",
                JointKind::Fixed => "F",
                JointKind::Revolute | JointKind::Continuous => "R",
                JointKind::Prismatic => "P",
                JointKind::Spherical => "S",
                JointKind::Floating => "X",
                _ => return Err(format!("the joint {} is of another type", joint.name)),
            };
            self.0 += &format!("{kind} {} {} ", joint.parent, joint.child);
            self.placement(&joint.origin);
            self.numbers("", &joint.axis);
            let Terms { damping, stiffness, rest, rotor_inertia, gear_ratio, .. } = joint.terms;
            self.numbers("", &[damping, stiffness, rest, gear_ratio.powi(2) * rotor_inertia]);
        }
        Ok(())
    }

    /// Names of coordinates, and the joints of each submechanism.
    fn groups(&mut self, description: &Description) {
        let parts = &description.submechanisms;
        for (name, list) in [
            ("tree", parts.iter().flat_map(|part| part.spanning_tree.clone()).collect::<Vec<_>>()),
            ("independent", parts.iter().flat_map(|part| part.independent.clone()).collect()),
            ("active", parts.iter().flat_map(|part| part.active.clone()).collect()),
        ] {
            self.list(name, &list);
        }
        self.line("groups", [parts.len()]);
        parts.iter().for_each(|part| self.list("", &part.spanning_tree));
    }

    /// The loops by rows that are independent.
    fn loops(&mut self, description: &Description, model: &Model) -> Result<(), String> {
        let redundant: Vec<String> =
            model.closures_at_zero().into_iter().flat_map(|of| of.redundant).collect();
        let all: Vec<Vec<Loop>> =
            (0..description.submechanisms.len()).map(|s| loops_of(description, s)).collect();
        self.line("loops", [all.iter().map(Vec::len).sum::<usize>()]);
        for (group, loops) in all.iter().enumerate() {
            for each in loops {
                self.0 += &format!("{group} {} {} ", each.predecessor, each.successor);
                match &each.cut {
                    Cut::AtJoint(joint) => self.0 += &format!("joint {joint}\n"),
                    Cut::AtLink(link) => self.0 += &format!("link {link}\n"),
                    Cut::Placed { predecessor, successor } => {
                        self.0 += "placed ";
                        self.placement(predecessor);
                        self.placement(successor);
                    }
                    _ => return Err(format!("the cut {} is of another kind", each.name)),
                }
                let is_held =
                    |row: &&Row| !redundant.contains(&format!("{}/{}", each.name, row.name));
                let rows: Vec<&Row> = each.rows.iter().filter(is_held).collect();
                self.line("", [rows.len()]);
                for row in rows {
                    if row.against.is_some() {
                        return Err(format!("the loop {} holds two axes", each.name));
                    }
                    self.numbers("", &row.axis);
                }
            }
        }
        Ok(())
    }

    fn couplings(&mut self, description: &Description) -> Result<(), String> {
        let coupled = description.joints.iter().enumerate();
        let coupled = coupled.filter_map(|(j, joint)| Some((j, joint, joint.coupling.as_ref()?)));
        self.line("couplings", [coupled.clone().count()]);
        for (j, joint, coupling) in coupled {
            if !coupling.curves.is_empty() {
                return Err(format!("the joint {} follows a curve", joint.name));
            }
            self.line(&j.to_string(), [coupling.terms.len()]);
            for (master, multiplier) in &coupling.terms {
                self.0 += &format!("{master} {multiplier:e} ");
            }
            self.numbers("", &[coupling.offset]);
        }
        Ok(())
    }

    /// A line of a name and values.
    fn line<T: Display>(&mut self, name: &str, values: impl IntoIterator<Item = T>) {
        self.0 += name;
        values.into_iter().for_each(|x| self.0 += &format!(" {x}"));
        self.0 += "\n";
    }

    fn numbers(&mut self, name: &str, numbers: &[f64]) {
        self.line(name, numbers.iter().map(|x| format!("{x:e}")));
    }

    fn list(&mut self, name: &str, list: &[usize]) {
        self.line(name, [list.len()].iter().chain(list));
    }

    fn placement(&mut self, placement: &Placement) {
        self.numbers("", &[placement.xyz, placement.rpy].concat());
    }
}

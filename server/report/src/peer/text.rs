//! A robot and its states in the format of the peers' programs: see the head of
//! `benches/peers/peer.hpp`.

use core::fmt::Display;

use sarrus_dynamics::description::{Cut, Description, JointKind, Loop, Placement};
use sarrus_dynamics::{Field, FieldSet, Planned, Query, Request, Status, loops_of};

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
    text.joints(description)?;
    text.groups(description);
    text.loops(description)?;
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

    fn joints(&mut self, description: &Description) -> Result<(), String> {
        self.line("joints", [description.joints.len()]);
        for joint in &description.joints {
            let kind = match joint.kind {
                JointKind::Fixed => "F",
                JointKind::Revolute | JointKind::Continuous => "R",
                JointKind::Prismatic => "P",
                _ => return Err(format!("the joint {} has several freedoms", joint.name)),
            };
            if joint.coupling.is_some() || joint.terms != Default::default() {
                return Err(format!(
                    "the joint {} has a coupling, a spring, a damper or a rotor",
                    joint.name
                ));
            }
            self.0 += &format!("{kind} {} {} ", joint.parent, joint.child);
            self.placement(&joint.origin);
            self.numbers("", &joint.axis);
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

    fn loops(&mut self, description: &Description) -> Result<(), String> {
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
                self.line("", [each.rows.len()]);
                for row in &each.rows {
                    if row.axis[..3] != [0.0; 3] || row.against.is_some() {
                        return Err(format!("the loop {} holds an angle", each.name));
                    }
                    self.numbers("", &row.axis[3..]);
                }
            }
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

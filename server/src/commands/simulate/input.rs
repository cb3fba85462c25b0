//! Forces on the robot: lists of numbers, tables over time, gains, springs.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use sarrus_dynamics::Model;
use sarrus_models::nearest_first;
use sarrus_simulation::{Input, Point, Source, Space, Spring};

use crate::commands::table::table as read;
use crate::commands::{Choices, choice};

/// Numbers separated by commas.
#[derive(Clone, Debug)]
pub(super) struct Numbers(pub(super) Vec<f64>);

impl FromStr for Numbers {
    type Err = String;

    fn from_str(text: &str) -> Result<Numbers, String> {
        if text.trim().is_empty() {
            return Ok(Numbers(Vec::new()));
        }
        let number = |part: &str| {
            part.trim().parse().map_err(|_| {
                format!("`{}` is no number, expected numbers separated by commas", part.trim())
            })
        };
        text.split(',').map(number).collect::<Result<_, _>>().map(Numbers)
    }
}

/// Flags of the forces on the robot.
#[derive(Args)]
pub(super) struct ForceFlags {
    /// Constant actuator forces.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    tau_u: Option<Numbers>,
    /// Constant forces on the independents.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    tau_y: Option<Numbers>,
    /// Forces over time: a first line `time,NAME,...` of actuators or independents, then a row for
    /// each time, with straight lines between.
    #[arg(long, value_name = "FILE.csv")]
    input: Option<PathBuf>,
    /// Stiffness towards the target: one number, or one for each joint.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    kp: Option<Numbers>,
    /// Damping: one number, or one for each joint.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    kd: Option<Numbers>,
    /// The position that kp pulls to: one number, or one for each joint; zero without it.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    target: Option<Numbers>,
    /// Which joints kp and kd act on.
    #[arg(long, value_parser = choice(&SPACES), value_name = "SPACE", default_value = "y")]
    control: Space,
    /// A spring with a damper between two points of links, such as `--spring base:0,0,0.1 hand
    /// 500,5,0.2`: stiffness N/m, damping N s/m, rest length m; may stand several times.
    #[arg(
        long,
        num_args = 3,
        value_names = ["LINK:X,Y,Z", "LINK:X,Y,Z", "K,C,L0"],
        allow_hyphen_values = true
    )]
    spring: Vec<String>,
}

const SPACES: Choices<Space, 2> =
    [(Space::Independent, "y", "Independents"), (Space::Actuator, "u", "Actuators")];

impl ForceFlags {
    /// Every input; counts and values are checked where they are used.
    pub(super) fn inputs(&self, model: &Model<f64>) -> Result<Vec<Input>, String> {
        let mut inputs = Vec::new();
        for (space, forces) in [(Space::Actuator, &self.tau_u), (Space::Independent, &self.tau_y)] {
            if let Some(Numbers(forces)) = forces {
                inputs.push(Input { space, source: Source::Constant(forces.clone()) });
            }
        }
        if let Some(path) = &self.input {
            inputs.push(table(path, model)?);
        }
        if self.kp.is_some() || self.kd.is_some() || self.target.is_some() {
            let space = self.control;
            let n = names_of(model, space).len();
            // one number stands for all
            let spread = |numbers: &Option<Numbers>| match numbers {
                None => vec![0.0; n],
                Some(Numbers(numbers)) if numbers.len() == 1 => vec![numbers[0]; n],
                Some(Numbers(numbers)) => numbers.clone(),
            };
            let source = Source::Gains {
                stiffness: spread(&self.kp),
                damping: spread(&self.kd),
                target: spread(&self.target),
            };
            inputs.push(Input { space, source });
        }
        Ok(inputs)
    }

    /// Every spring.
    pub(super) fn springs(&self, model: &Model<f64>) -> Result<Vec<Spring>, String> {
        let spring = |[from, to, constants]: &[String; 3]| match constants
            .parse::<Numbers>()?
            .0
            .as_slice()
        {
            [stiffness, damping, rest] => Ok(Spring {
                from: point(from, model)?,
                to: point(to, model)?,
                stiffness: *stiffness,
                damping: *damping,
                rest: *rest,
            }),
            other => Err(format!(
                "--spring {constants}: found {} number(s), expected stiffness, damping and \
                     rest length",
                other.len()
            )),
        };
        self.spring.as_chunks().0.iter().map(spring).collect()
    }
}

/// The names of a space's joints.
fn names_of(model: &Model<f64>, space: Space) -> &[String] {
    match space {
        Space::Independent => model.independent_names(),
        Space::Actuator => model.active_names(),
    }
}

/// A link with or without a point on it.
fn point(text: &str, model: &Model<f64>) -> Result<Point, String> {
    let index = |name: &str| model.link_names().iter().position(|link| link == name);
    // a link's own name may hold a colon
    if let Some(link) = index(text) {
        return Ok(Point { link, at: [0.0; 3] });
    }
    let (name, at) = text.rsplit_once(':').unwrap_or((text, "0,0,0"));
    let Some(link) = index(name) else {
        return Err(format!(
            "--spring {text}: there is no link `{name}`, expected one of {}",
            nearest_first(name, model.link_names().iter().map(String::as_str), 250)
        ));
    };
    let Numbers(at) = at.parse().map_err(|words| format!("--spring {text}: {words}"))?;
    let found = at.len();
    let at = at
        .try_into()
        .map_err(|_| format!("--spring {text}: found {found} number(s), expected x,y,z"))?;
    Ok(Point { link, at })
}

/// Forces over time from a file.
fn table(path: &Path, model: &Model<f64>) -> Result<Input, String> {
    let file = path.display();
    let (_, rows, heads) = read(path).map_err(|failure| failure.reason)?;
    let Some((_, names)) = heads.split_first().filter(|(first, _)| *first == "time") else {
        return Err(format!(
            "{file}:1: found {:?}, expected a first line `time,NAME,...`",
            heads.join(",")
        ));
    };
    // all names are of one space
    let spaces = [Space::Actuator, Space::Independent];
    let [actuators, independents] = spaces.map(|space| names_of(model, space));
    let fits = |space: &Space| names.iter().all(|name| names_of(model, *space).contains(name));
    let Some(space) = spaces.into_iter().find(fits) else {
        let is_unknown = |name: &&String| !actuators.contains(name) && !independents.contains(name);
        let unknown = names.iter().find(is_unknown);
        let found = unknown.map_or("names of actuators and of independents".to_owned(), |name| {
            format!("the name `{name}`")
        });
        return Err(format!(
            "{file}:1: found {found}, expected actuators ({}) or independents ({})",
            actuators.join(", "),
            independents.join(", ")
        ));
    };
    // joints without a column get no force
    let column = |name: &String| names.iter().position(|head| head == name);
    let forces = |row: &Vec<f64>| {
        let force = |name: &String| column(name).map_or(0.0, |column| row[column + 1]);
        names_of(model, space).iter().map(force).collect()
    };
    let times = rows.iter().map(|row| row[0]).collect();
    let forces = rows.iter().map(forces).collect();
    Ok(Input { space, source: Source::Table { times, forces } })
}

//! Reads a line: its inputs and its wanted outputs, or the reason why it is invalid.

use std::iter;
use std::ops::RangeInclusive;
use std::time::Duration;

use sarrus_client::{
    Axes, Field, FieldSet, ModelInfo, Query, QueryError, QueryOptions, Request, Status,
};
use sarrus_models::{matching_joints, nearest_first};

use sarrus_proto::{MAX_DIRECTIONS, TaskParts, Tolerance};

use super::json::{Fault, Value};
use super::request::{Asked, Given, INPUTS, Output, Problem, Read};
use super::tasks::key_of;

/// More than there are keys of a line or names of outputs.
const MOST: usize = 128;

/// Reads a line for one kind of request on one model; without one the line names its own.
pub(super) fn read(
    request: Option<Request>,
    [loop_tolerance, projection_tolerance]: [Tolerance; 2],
    model: &ModelInfo,
    line: &str,
) -> Read<Asked> {
    let root = Value::parse(line)?;
    let members =
        root.members(MOST).ok_or_else(|| root.is_no("an object such as {\"y\": [0.1]}"))?;
    let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::EMPTY);
    let mut reader = Reader {
        model,
        request,
        query: Query { loop_tolerance, projection_tolerance, ..query },
        keys: Vec::new(),
        want: None,
        frames: None,
        wrenches: Vec::new(),
        deadline: None,
        tasks: Vec::new(),
        contacts: Vec::new(),
        motions: Vec::new(),
        all_solutions: None,
        given: Vec::new(),
        doubt: None,
    };
    for (key, value) in members {
        reader.member(key, value)?;
    }
    reader.finish(root)
}

/// A number from 0 on.
fn from_zero(name: &str, value: Value<'_>) -> Read<f64> {
    let number = value.number().filter(|x| *x >= 0.0);
    number.ok_or_else(|| value.is_no(&format!("{name} as a number from 0 on")))
}

/// The axes of frames.
fn axes(value: Value<'_>) -> Read<Axes> {
    let name = value.string();
    let known = Axes::ALL.iter().copied().find(|axes| Some(axes.name()) == name.as_deref());
    known.ok_or_else(|| value.is_no("axes as \"mixed\", \"world\" or \"local\""))
}

/// Microseconds from 1 on.
fn deadline(value: Value<'_>) -> Read<Duration> {
    let number = value.number().filter(|x| (1.0..=1e9).contains(x) && x.fract() == 0.0);
    let expected = "deadline_us as whole microseconds from 1 to 1000000000";
    number.map(|us| Duration::from_micros(us as u64)).ok_or_else(|| value.is_no(expected))
}

/// The members of a line that were read so far.
pub(super) struct Reader<'a> {
    pub(super) model: &'a ModelInfo,
    request: Option<Request>,
    /// Its request, fields, frames and wrenches come last.
    query: Query,
    keys: Vec<(String, usize)>,
    want: Option<Vec<(Output, usize)>>,
    pub(super) frames: Option<Vec<(String, u16)>>,
    wrenches: Vec<(u16, Vec<f64>)>,
    deadline: Option<Duration>,
    /// Link and parts of each task.
    pub(super) tasks: Vec<(u16, TaskParts)>,
    /// Links that are held; the tasks' keys that belong to a step of a motion, with their places.
    pub(super) contacts: Vec<u16>,
    pub(super) motions: Vec<(String, usize)>,
    /// Where all solutions are asked for.
    pub(super) all_solutions: Option<usize>,
    pub(super) given: Vec<Given>,
    doubt: Option<Problem>,
}

impl Reader<'_> {
    fn member(&mut self, key: Value<'_>, value: Value<'_>) -> Read {
        let name = key.string().ok_or_else(|| key.fault("a key that is no text".to_owned()))?;
        if self.keys.iter().any(|(known, _)| *known == name) {
            return Err(key.fault(format!("`{name}` stands here twice")));
        }
        match name.as_str() {
            "request" if self.request.is_none() => self.request = Some(named_request(value)?),
            "want" => self.want = Some(wants(value)?),
            "frames" => self.frames = Some(self.links(value)?),
            "joints" => self.query = self.query.with_joints(self.read_joints(value)?),
            "wrenches" => self.wrenches = self.read_wrenches(value)?,
            "loop_tolerance" => {
                self.query = self.query.with_loop_tolerance(from_zero(&name, value)?);
            }
            "projection_tolerance" => {
                self.query = self.query.with_projection_tolerance(from_zero(&name, value)?);
            }
            "search" => self.option("search", QueryOptions::SEARCH, value)?,
            "friction" => self.option("friction", QueryOptions::FRICTION, value)?,
            "axes" => self.query = self.query.with_axes(axes(value)?),
            "relative_to" => {
                let expected = "relative_to as the name of a link";
                let name = value.string().ok_or_else(|| value.is_no(expected))?;
                self.query = self.query.relative_to(self.link(&name, value)?);
            }
            "deadline_us" => self.deadline = Some(deadline(value)?),
            _ if self.task_member(key, value)? => {}
            _ => match self.given(&name, value)? {
                Some((field, numbers)) => {
                    self.given.push(Given { field, numbers, offset: key.offset });
                }
                None => {
                    let known: Vec<&str> = INPUTS.iter().map(|field| field.name()).collect();
                    let known = format!(
                        "{}, wrenches, directions, gains_u, direction, dt, gain, observer, \
                         frames, joints, want, loop_tolerance, projection_tolerance, axes, \
                         relative_to, search, friction, deadline_us, tasks, contacts, com, bounds, \
                         clearance, all",
                        known.join(", ")
                    );
                    return Err(key.fault(format!(
                        "{} is no key of a request, expected one of {known}",
                        shown(&name)
                    )));
                }
            },
        }
        self.keys.push((name, key.offset));
        Ok(())
    }

    /// The numbers of a field that a request gives.
    fn given(&mut self, name: &str, value: Value<'_>) -> Read<Option<(Field, Vec<f64>)>> {
        let sizes = self.model.sizes;
        let n = sizes.n_vy;
        Ok(Some(match name {
            "dt" | "gain" => {
                let field = if name == "dt" { Field::Dt } else { Field::Gain };
                (field, vec![from_zero(name, value)?])
            }
            "observer" => {
                (Field::Observer, self.read_rows("a row of the observer", value, n..=n, 3)?)
            }
            "directions" => {
                let numbers = self.read_rows("a direction", value, 1..=MAX_DIRECTIONS, n)?;
                self.query.n_directions = (numbers.len() / n.max(1)) as u64;
                (Field::Directions, numbers)
            }
            "gains_u" => {
                let expected =
                    "gains_u as an object such as {\"stiffness\": [100], \"damping\": [5]}";
                let parts = [("stiffness", sizes.n_u), ("damping", sizes.n_u)];
                let [k, d] = self.read_parts(value, expected, parts)?;
                (Field::GainsU, k.into_iter().zip(d).flat_map(<[f64; 2]>::from).collect())
            }
            "direction" => {
                let expected =
                    "direction as an object such as {\"y\": [1], \"yd\": [0], \"tau\": [0]}";
                let parts = [("y", n), ("yd", n), ("tau", sizes.n_u)];
                (Field::Direction, self.read_parts(value, expected, parts)?.concat())
            }
            _ => {
                let Some(field) = INPUTS.into_iter().find(|field| field.name() == name) else {
                    return Ok(None);
                };
                (field, self.numbers(name, value, field.shape(&sizes, 0, 0).0)?)
            }
        }))
    }

    /// Adds an option of queries where it is true.
    fn option(&mut self, name: &str, option: QueryOptions, value: Value<'_>) -> Read {
        let expected = || value.is_no(&format!("{name} as true or false"));
        if value.boolean().ok_or_else(expected)? {
            self.query = self.query.with_options(option);
        }
        Ok(())
    }

    /// A list of `n` finite numbers; another count or a number that is not finite is a doubt.
    pub(super) fn numbers(&mut self, name: &str, value: Value<'_>, n: usize) -> Read<Vec<f64>> {
        let expected = format!("{name} as a list of {n} numbers");
        let (numbers, count) = list(value, n, Value::number, &expected)?;
        if let Some((_, item)) = numbers.iter().find(|(number, _)| !number.is_finite()) {
            self.doubt(Status::NonFiniteInput, item.offset, || {
                format!("{name} has a number beyond the range of a double")
            });
        }
        if count != n {
            self.doubt(Status::WrongSize, value.offset, || {
                format!("{name} has {count} numbers, expected {n}")
            });
        }
        Ok(numbers.into_iter().map(|(number, _)| number).collect())
    }

    /// Keeps the first doubt; a wrong size comes before a number that is not finite.
    pub(super) fn doubt(&mut self, status: Status, offset: usize, words: impl FnOnce() -> String) {
        let weight = |status| if status == Status::WrongSize { 0 } else { 1 };
        if self.doubt.as_ref().is_none_or(|doubt| weight(status) < weight(doubt.status)) {
            self.doubt = Some(Problem { status, offset, words: words() });
        }
    }

    pub(super) fn links(&self, value: Value<'_>) -> Read<Vec<(String, u16)>> {
        let mut links: Vec<(String, u16)> = Vec::new();
        let most = self.model.links.len() + 1;
        let (listed, _) = list(value, most, Value::string, "frames as a list of links")?;
        for (name, item) in listed {
            let link = self.link(&name, item)?;
            if links.iter().any(|(_, known)| *known == link) {
                return Err(item.fault(format!("`{name}` stands here twice")));
            }
            links.push((name, link));
        }
        Ok(links)
    }

    /// Joints by names with `*`, `?` and `[…]`.
    fn read_joints(&self, value: Value<'_>) -> Read<Vec<u16>> {
        let mut velocities = Vec::new();
        let most = self.model.tree.len().max(MOST);
        let expected = "joints as a list such as [\"AL*\"]";
        let (listed, count) = list(value, most, Value::string, expected)?;
        if count > most {
            return Err(value.fault(format!("more than {most} names of joints stand here")));
        }
        for (name, item) in listed {
            let matching = matching_joints(self.model, &name);
            if matching.is_empty() {
                let joints = nearest_first(&name, self.model.joints().map(|joint| joint.name), 250);
                return Err(item.fault(format!(
                    "{} matches none of the {} joints of {}, expected some of {joints}",
                    shown(&name),
                    self.model.joints().count(),
                    self.model.robot
                )));
            }
            velocities.extend(matching);
        }
        velocities.sort_unstable();
        velocities.dedup();
        if velocities.is_empty() {
            return Err(value.fault("no joint stands here, expected [\"AL*\"] or so".to_owned()));
        }
        Ok(velocities)
    }

    fn read_wrenches(&mut self, value: Value<'_>) -> Read<Vec<(u16, Vec<f64>)>> {
        let expected = "wrenches as an object such as {\"link\": [nx,ny,nz,fx,fy,fz]}";
        let members =
            value.members(self.model.links.len() + 1).ok_or_else(|| value.is_no(expected))?;
        let mut wrenches: Vec<(u16, Vec<f64>)> = Vec::new();
        for (key, value) in members {
            let name =
                key.string().ok_or_else(|| key.fault("a link that is no text".to_owned()))?;
            let link = self.link(&name, key)?;
            if wrenches.iter().any(|(known, _)| *known == link) {
                return Err(key.fault(format!("`{name}` stands here twice")));
            }
            wrenches.push((link, self.numbers(&format!("the wrench on `{name}`"), value, 6)?));
        }
        // members of an object have no order; plans take ascending links
        wrenches.sort_by_key(|(link, _)| *link);
        Ok(wrenches)
    }

    /// Rows of `n` numbers, one after the other.
    fn read_rows(
        &mut self,
        what: &str,
        value: Value<'_>,
        count: RangeInclusive<usize>,
        n: usize,
    ) -> Read<Vec<f64>> {
        let mut listed = Vec::new();
        let is_list = value.items(|item| {
            listed.push(item);
            listed.len() <= *count.end()
        });
        if is_list.is_none() || !count.contains(&listed.len()) {
            let times = match count.start() == count.end() {
                true => count.end().to_string(),
                false => format!("{} to {}", count.start(), count.end()),
            };
            let row = vec!["0"; n.min(3)].join(",");
            let expected = format!("{times} times {what} of {n} numbers such as [[{row}]]");
            return Err(value.is_no(&expected));
        }
        let mut numbers = Vec::new();
        for item in listed {
            let row = self.numbers(what, item, n)?;
            numbers.extend(row.into_iter().chain(iter::repeat(0.0)).take(n));
        }
        Ok(numbers)
    }

    /// Lists of these names and lengths, zeros where one is missing.
    fn read_parts<const N: usize>(
        &mut self,
        value: Value<'_>,
        expected: &str,
        parts: [(&str, usize); N],
    ) -> Read<[Vec<f64>; N]> {
        let mut lists = parts.map(|(_, n)| vec![0.0; n]);
        for (key, value) in value.members(N).ok_or_else(|| value.is_no(expected))? {
            let name = key.string().unwrap_or_default();
            let at = parts.iter().position(|(known, _)| *known == name);
            let at = at.ok_or_else(|| key.is_no(expected))?;
            let numbers = self.numbers(&name, value, parts[at].1)?;
            lists[at].iter_mut().zip(numbers).for_each(|(to, x)| *to = x);
        }
        Ok(lists)
    }

    pub(super) fn link(&self, name: &str, at: Value<'_>) -> Read<u16> {
        let n = self.model.links.len();
        self.model.link(name).ok_or_else(|| {
            let links = nearest_first(name, self.model.links.iter().map(String::as_str), 250);
            at.fault(format!(
                "{} is none of the {n} links of {}, expected one of {links}",
                shown(name),
                self.model.robot
            ))
        })
    }

    fn finish(mut self, root: Value<'_>) -> Read<Asked> {
        let request = self.request.ok_or_else(|| {
            root.fault(format!("it names no request, expected \"request\": {}", requests()))
        })?;
        self.finish_tasks(request, root)?;
        // the members of the answer
        let mut outputs = match self.want {
            Some(want) => want,
            None => request
                .default_want()
                .iter()
                .map(|field| (Output::Field(field), root.offset))
                .collect(),
        };
        if let Some(offset) = self.all_solutions {
            outputs.push((Output::Field(Field::Solutions), offset));
        }
        match outputs.iter().find(|(output, _)| is_of_frames(*output)) {
            Some((output, offset)) if self.frames.is_none() => {
                let words = format!(
                    "`{}` is wanted of no link, expected \"frames\": [\"link\"] beside it",
                    output.name()
                );
                return Err(Fault { offset: *offset, words }.into());
            }
            _ if self.frames.is_some()
                && !outputs.iter().any(|(output, _)| *output == Output::Frames) =>
            {
                outputs.push((Output::Frames, root.offset));
            }
            _ => {}
        }

        // the query
        let given = self.given.iter().fold(FieldSet::EMPTY, |set, given| set.with(given.field));
        let want = outputs
            .iter()
            .fold(FieldSet::EMPTY, |set, (output, _)| FieldSet(set.0 | output.fields().0));
        let mut query = Query { request: request as u32, given, want, ..self.query };
        // the frames of tasks are those of the query
        let model = self.model;
        let of_tasks = || {
            let links = self.tasks.iter().map(|(link, _)| *link);
            links.map(|link| (model.links[usize::from(link)].clone(), link)).collect()
        };
        let frames =
            if self.tasks.is_empty() { self.frames.unwrap_or_default() } else { of_tasks() };
        query = query.with_frames(&frames.iter().map(|(_, link)| *link).collect::<Vec<u16>>());
        if !self.tasks.is_empty() {
            query = query.with_tasks(&self.tasks);
        }
        if !self.wrenches.is_empty() {
            query = query
                .with_wrenches(&self.wrenches.iter().map(|(link, _)| *link).collect::<Vec<u16>>());
        }
        query.check(self.model).map_err(|error| refused(&error, &self.keys, &outputs, root))?;

        let mut given = self.given;
        if !self.wrenches.is_empty() {
            let numbers = self.wrenches.into_iter().flat_map(|(_, wrench)| wrench).collect();
            given.push(Given { field: Field::Wrenches, numbers, offset: root.offset });
        }
        Ok(Asked {
            query,
            outputs: outputs.into_iter().map(|(output, _)| output).collect(),
            frames: frames.into_iter().map(|(name, _)| name).collect(),
            given,
            deadline: self.deadline,
            doubt: self.doubt,
        })
    }
}

/// An invalid query, at the key that it comes from.
fn refused(
    error: &QueryError,
    keys: &[(String, usize)],
    outputs: &[(Output, usize)],
    root: Value<'_>,
) -> Problem {
    let key = |name: &str| keys.iter().find(|(known, _)| known == name).map(|(_, offset)| *offset);
    let offset = match error {
        QueryError::NotAnInput(field) => key(key_of(*field)),
        QueryError::BadTask(_) => key("tasks").or(key("axes")),
        QueryError::Conflict(a, b) => key(a.name()).max(key(b.name())),
        QueryError::NotAnOutput(field) => {
            let found = outputs.iter().find(|(output, _)| *output == Output::Field(*field));
            found.map(|(_, offset)| *offset)
        }
        QueryError::TooMany { what: "runs of joints", .. } => key("joints"),
        QueryError::TooMany { what, .. } => key(what),
        _ => None,
    };
    Fault { offset: offset.unwrap_or(root.offset), words: error.to_string() }.into()
}

fn named_request(value: Value<'_>) -> Read<Request> {
    let name = value.string().ok_or_else(|| value.is_no(&requests()))?;
    let found = Request::ALL.iter().copied().find(|request| request.name() == name);
    found.ok_or_else(|| {
        value.fault(format!("{} is no request, expected {}", shown(&name), requests()))
    })
}

/// True for a member of an answer that needs links.
fn is_of_frames(output: Output) -> bool {
    use Field::{DjacobianDy, JdYd, TaskBias, TaskGravity, TaskInertia, TaskRank};
    let Output::Field(field) = output else {
        return matches!(output, Output::Frames | Output::Jacobians);
    };
    matches!(field, JdYd | DjacobianDy | TaskInertia | TaskBias | TaskGravity | TaskRank)
}

/// The names of all requests.
fn requests() -> String {
    let names: Vec<String> =
        Request::ALL.iter().map(|request| format!("\"{}\"", request.name())).collect();
    format!("one of {}", names.join(", "))
}

fn wants(value: Value<'_>) -> Read<Vec<(Output, usize)>> {
    let mut wants: Vec<(Output, usize)> = Vec::new();
    let (listed, _) = list(value, MOST, Value::string, "want as a list of names")?;
    for (name, item) in listed {
        let output = Output::from_name(&name).ok_or_else(|| {
            let known: Vec<&str> = Field::ALL
                .iter()
                .map(|field| field.name())
                .filter(|name| Output::from_name(name).is_some())
                .collect();
            item.fault(format!(
                "{} cannot be wanted, expected some of {}, frames, jacobians",
                shown(&name),
                known.join(", ")
            ))
        })?;
        if wants.iter().any(|(known, _)| *known == output) {
            return Err(item.fault(format!("`{name}` stands here twice")));
        }
        wants.push((output, item.offset));
    }
    Ok(wants)
}

/// The first `most` items of a list with their values, and the number of all items.
pub(super) fn list<'a, T>(
    value: Value<'a>,
    most: usize,
    read: impl Fn(&Value<'a>) -> Option<T>,
    expected: &str,
) -> Read<(Vec<(T, Value<'a>)>, usize)> {
    let mut items = Vec::new();
    let mut count = 0;
    let mut other = None;
    let is_list = value.items(|item| {
        count += 1;
        match read(&item) {
            Some(read) if items.len() < most => items.push((read, item)),
            Some(_) => {}
            None => other = Some(item),
        }
        other.is_none()
    });
    match (is_list, other) {
        (Some(()), None) => Ok((items, count)),
        (_, item) => Err(item.unwrap_or(value).is_no(expected)),
    }
}

impl Value<'_> {
    pub(super) fn fault(&self, words: String) -> Problem {
        Fault { offset: self.offset, words }.into()
    }

    pub(super) fn is_no(&self, expected: &str) -> Problem {
        self.fault(format!("{}, expected {expected}", self.kind()))
    }
}

/// A name in backticks, shortened when long.
fn shown(name: &str) -> String {
    const LONGEST: usize = 60;
    let short: String = name.chars().take(LONGEST).collect();
    if short.len() < name.len() { format!("`{short}…`") } else { format!("`{short}`") }
}

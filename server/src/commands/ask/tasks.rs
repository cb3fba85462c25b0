//! Reads the tasks and bounds of a request that searches for positions.

use sarrus_client::{Field, ModelInfo, Request, Status};
use sarrus_proto::{MAX_FRAMES, TASK_NUMBERS, TaskParts};

use super::json::{Fault, Value};
use super::read::{Reader, list};
use super::request::{Given, Problem, Read};

/// A bound that is null is none; numbers that travel are finite.
const NONE: f64 = f64::MAX;

/// Numbers of a wanted twist or acceleration, with the weight.
const MOTION: usize = 7;

/// The key in a line of the field of a task, where it has another name.
pub(super) fn key_of(field: Field) -> &'static str {
    match field {
        Field::TaskTarget | Field::TaskMotion => "tasks",
        Field::ComTarget => "com",
        Field::BoundsY | Field::BoundsU => "bounds",
        _ => field.name(),
    }
}

impl Reader<'_> {
    /// A member of a request with tasks; false for any other.
    pub(super) fn task_member(&mut self, key: Value<'_>, value: Value<'_>) -> Read<bool> {
        let name = key.string().unwrap_or_default();
        let (field, numbers) = match name.as_str() {
            "tasks" => (Field::TaskTarget, self.read_tasks(value)?),
            "contacts" => {
                self.contacts = self.links(value)?.into_iter().map(|(_, link)| link).collect();
                return Ok(true);
            }
            "bounds" => {
                self.read_bounds(key, value)?;
                return Ok(true);
            }
            "com" => (Field::ComTarget, self.numbers(&name, value, 3)?),
            "clearance" => {
                let number = value.number().filter(|x| *x >= 0.0);
                (Field::Clearance, vec![number.ok_or_else(|| value.is_no("a number from 0 on"))?])
            }
            "all" => {
                let all = value.boolean().ok_or_else(|| value.is_no("all as true or false"))?;
                self.all_solutions = all.then_some(key.offset);
                return Ok(true);
            }
            _ => return Ok(false),
        };
        self.given.push(Given { field, numbers, offset: key.offset });
        Ok(true)
    }

    /// Packs the tasks of a request for one step of a motion, with the contacts behind them, and
    /// refuses parts that belong to other requests.
    pub(super) fn finish_tasks(&mut self, request: Request, root: Value<'_>) -> Read {
        let motion = match request {
            Request::DifferentialInverseKinematics => "twist",
            Request::Step => "acc",
            _ => "",
        };
        if let Some((name, offset)) = self.motions.iter().find(|(name, _)| *name != motion) {
            let words = format!("`{name}` belongs to a task of another request");
            return Err(Fault { offset: *offset, words }.into());
        }
        if motion.is_empty() {
            return match self.contacts.is_empty() {
                true => Ok(()),
                false => Err(root.fault("contacts belong to a step of a motion".to_owned())),
            };
        }
        if self.frames.is_some() {
            let words = "frames are no part of a step; each task names its own".to_owned();
            return Err(root.fault(words));
        }
        let mut given = self.given.iter();
        if let Some(dt) = given.find(|given| given.field == Field::Dt && given.numbers == [0.0]) {
            let words = "dt is 0, expected the time of a step, above 0".to_owned();
            return Err(Fault { offset: dt.offset, words }.into());
        }
        if self.motions.len() < self.tasks.len() {
            return Err(root.fault(format!("a task has no `{motion}`, or has more")));
        }
        let numbers = self.given.iter_mut().find(|given| given.field == Field::TaskTarget);
        if let Some(given) = numbers {
            given.field = Field::TaskMotion;
            let rows = given.numbers.chunks_exact(TASK_NUMBERS);
            let packed = |row: &[f64]| [&row[..6], &row[TASK_NUMBERS - 1..]].concat();
            given.numbers = rows.flat_map(packed).collect();
        } else if !self.contacts.is_empty() {
            let numbers = Vec::new();
            self.given.push(Given { field: Field::TaskMotion, numbers, offset: root.offset });
        }
        let held = TaskParts::HELD.with(TaskParts::POSITION).with(TaskParts::ORIENTATION);
        let still = self.contacts.len() * MOTION;
        self.tasks.extend(self.contacts.iter().map(|link| (*link, held)));
        let given = self.given.iter_mut().find(|given| given.field == Field::TaskMotion);
        given.into_iter().for_each(|given| given.numbers.extend(vec![0.0; still]));
        Ok(())
    }

    /// The packed targets; their frames and parts into the query.
    fn read_tasks(&mut self, value: Value<'_>) -> Read<Vec<f64>> {
        let expected = "tasks as a list such as [{\"frame\": \"hand\", \"p\": [0.3, 0, 1]}]";
        let (listed, _) = list(value, MAX_FRAMES + 1, |item| item.members(16), expected)?;
        if listed.is_empty() {
            return Err(value.is_no("tasks as a list of one or more, or no tasks"));
        }
        let mut packed = Vec::new();
        for (members, item) in listed {
            let mut frame = None;
            let mut kinds = [false; 2];
            let mut parts = TaskParts::default();
            let mut numbers = [0.0; TASK_NUMBERS];
            numbers[TASK_NUMBERS - 1] = 1.0;
            for (key, value) in members {
                let name = key.string().unwrap_or_default();
                let mut part = |of: TaskParts, first: usize, n: usize| {
                    kinds[usize::from(n == 6)] = true;
                    let read = self.numbers(&name, value, n)?;
                    numbers[first..first + n].iter_mut().zip(read).for_each(|(to, x)| *to = x);
                    parts = parts.with(of);
                    Ok::<(), Problem>(())
                };
                match name.as_str() {
                    "frame" => {
                        let name = value.string();
                        let name = name.ok_or_else(|| value.is_no("the name of a link"))?;
                        frame = Some(self.link(&name, value)?);
                    }
                    "p" => part(TaskParts::POSITION, 0, 3)?,
                    "quat" => part(TaskParts::ORIENTATION, 3, 4)?,
                    "axis" => part(TaskParts::AXIS, 7, 3)?,
                    "twist" | "acc" => {
                        part(TaskParts::POSITION.with(TaskParts::ORIENTATION), 0, 6)?;
                        self.motions.push((name, key.offset));
                    }
                    "weight" => {
                        let weight = value.number().filter(|x| *x > 0.0 && x.is_finite());
                        numbers[TASK_NUMBERS - 1] =
                            weight.ok_or_else(|| value.is_no("a weight above 0"))?;
                    }
                    "priority" => match value.number() {
                        Some(0.0) => {}
                        Some(1.0) => parts = parts.with(TaskParts::SECOND),
                        _ => return Err(value.is_no("priority as 0 or 1")),
                    },
                    _ => {
                        let known = "frame, p, quat, axis, twist, acc, weight, priority";
                        return Err(key.fault(format!(
                            "`{name}` is no key of a task, expected one of {known}"
                        )));
                    }
                }
            }
            if kinds == [true; 2] {
                return Err(item.fault("a task has a pose and a motion".to_owned()));
            }
            let frame = frame.ok_or_else(|| item.fault("a task names no frame".to_owned()))?;
            self.tasks.push((frame, parts));
            packed.extend(numbers);
        }
        Ok(packed)
    }

    fn read_bounds(&mut self, key: Value<'_>, value: Value<'_>) -> Read {
        let expected = "bounds as an object such as {\"y\": [[-1, 1]], \"u\": [[0, null]]}";
        let members = value.members(3).ok_or_else(|| value.is_no(expected))?;
        for (space, value) in members {
            let ModelInfo { sizes, .. } = *self.model;
            let (field, n) = match space.string().as_deref() {
                Some("y") => (Field::BoundsY, sizes.n_qy),
                Some("u") => (Field::BoundsU, sizes.n_u),
                _ => return Err(space.is_no("\"y\" or \"u\"")),
            };
            let bound = |item: &Value<'_>| match item.kind() {
                "null" => Some(f64::NAN),
                _ => item.number(),
            };
            let pair = |item: &Value<'_>| {
                let (pair, count) = list(*item, 2, bound, "").ok()?;
                let [lower, upper] = [pair.first()?.0, pair.get(1)?.0];
                (count == 2).then(|| {
                    let or = |x: f64, none: f64| if x.is_finite() { x } else { none };
                    [or(lower, -NONE), or(upper, NONE)]
                })
            };
            let (pairs, count) = list(value, n, pair, "bounds as a list of [lower, upper]")?;
            if count != n {
                self.doubt(Status::WrongSize, value.offset, || {
                    format!("{} has {count} pairs, expected {n}", field.name())
                });
            }
            let numbers = pairs.into_iter().flat_map(|(pair, _)| pair).collect();
            self.given.push(Given { field, numbers, offset: key.offset });
        }
        Ok(())
    }
}

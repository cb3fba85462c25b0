//! Reads the tasks and bounds of a request that searches for positions.

use sarrus_client::{Field, ModelInfo, Status};
use sarrus_proto::{MAX_FRAMES, TASK_NUMBERS, TaskParts};

use super::json::Value;
use super::read::{Reader, list};
use super::request::{Given, Problem};

/// A bound that is null is none; numbers that travel are finite.
const NONE: f64 = f64::MAX;

/// The key in a line of the field of a task, where it has another name.
pub(super) fn key_of(field: Field) -> &'static str {
    match field {
        Field::TaskTarget => "tasks",
        Field::ComTarget => "com",
        Field::BoundsY | Field::BoundsU => "bounds",
        _ => field.name(),
    }
}

impl Reader<'_> {
    /// A member of a request with tasks; false for any other.
    pub(super) fn task_member(
        &mut self,
        key: Value<'_>,
        value: Value<'_>,
    ) -> Result<bool, Problem> {
        let name = key.string().unwrap_or_default();
        let (field, numbers) = match name.as_str() {
            "tasks" => {
                let numbers = self.read_tasks(value)?;
                (Field::TaskTarget, numbers)
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

    /// The packed targets; their frames and parts into the query.
    fn read_tasks(&mut self, value: Value<'_>) -> Result<Vec<f64>, Problem> {
        let expected = "tasks as a list such as [{\"frame\": \"hand\", \"p\": [0.3, 0, 1]}]";
        let (listed, _) = list(value, MAX_FRAMES + 1, |item| item.members(16), expected)?;
        let mut packed = Vec::new();
        for (members, item) in listed {
            let mut frame = None;
            let mut parts = TaskParts::default();
            let mut numbers = [0.0; TASK_NUMBERS];
            numbers[TASK_NUMBERS - 1] = 1.0;
            for (key, value) in members {
                let name = key.string().unwrap_or_default();
                let mut part = |of: TaskParts, first: usize, n: usize| {
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
                        let known = "frame, p, quat, axis, weight, priority";
                        return Err(key.fault(format!(
                            "`{name}` is no key of a task, expected one of {known}"
                        )));
                    }
                }
            }
            let frame = frame.ok_or_else(|| item.fault("a task names no frame".to_owned()))?;
            self.tasks.push((frame, parts));
            packed.extend(numbers);
        }
        Ok(packed)
    }

    fn read_bounds(&mut self, key: Value<'_>, value: Value<'_>) -> Result<(), Problem> {
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

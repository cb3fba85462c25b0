//! One line out.

use std::ops::Range;

use sarrus_client::{Answer, Field, Layout, ModelInfo, Query, Status, Warnings};
use sarrus_proto::{FIELDS, Rows, Slot};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::request::{Asked, Output};

/// The Jacobian of the actuators in the object of a link.
const ACTUATOR: &str = "actuator";

/// Difference of two limits that are one.
const SAME: f64 = 1e-9;

/// The reason why there are no numbers, and the column of the fault if it has one.
pub(super) struct Remark {
    pub(super) column: Option<usize>,
    pub(super) words: String,
}

/// The answer to an invalid line.
pub(super) fn bad_request(out: &mut Vec<u8>, remark: &Remark) {
    write(out, head(Status::BadRequest, &[]), Some(remark));
}

/// The answer to a request: `numbers` have the given layout; wanted fields outside of it are null.
pub(super) fn answer(
    out: &mut Vec<u8>,
    asked: &Asked,
    model: &ModelInfo,
    answer: Answer,
    layout: &Layout,
    numbers: &[f64],
    remark: Option<&Remark>,
) {
    let names: Vec<&str> = answer.warnings.names().collect();
    let mut line = head(answer.status, &names);
    let part = |field| {
        let slot = layout.slot(field)?;
        let numbers = numbers.get(slot.range())?;
        // only few fields of a failed answer are valid
        let is_valid = matches!(answer.status, Status::Ok | Status::NotReached)
            || field.survives_failure() && numbers.iter().all(|number| number.is_finite());
        is_valid.then_some((slot, numbers))
    };
    for output in &asked.outputs {
        let value = match output {
            Output::Field(field) => {
                let of = |(slot, numbers)| match field {
                    Field::Limits => {
                        let forces = part(Field::TauU).map(|(_, forces)| forces);
                        json!(exceeded(numbers, model, &Rows::of(&asked.query, model), forces))
                    }
                    _ => value(slot, numbers, model, &asked.query),
                };
                part(*field).map(of).into()
            }
            Output::Frames => {
                let parts = [
                    ("p", Field::FramePose, 0..3),
                    ("quat", Field::FramePose, 3..7),
                    ("twist", Field::FrameTwist, 0..6),
                    ("acc", Field::FrameAcc, 0..6),
                ];
                let parts = parts.map(|(name, field, range)| (name, part(field), range));
                by_link(asked, &parts, |k, (slot, numbers), range| {
                    let numbers = numbers.iter().skip(k * slot.columns + range.start);
                    numbers.take(range.len()).copied().collect()
                })
            }
            Output::Jacobians => {
                let parts = [
                    ("tree", Field::JacobianTree),
                    ("independent", Field::JacobianIndependent),
                    (ACTUATOR, Field::JacobianActuator),
                ];
                let parts = parts.map(|(name, field)| (name, part(field), ()));
                by_link(asked, &parts, |k, (slot, numbers), ()| {
                    let numbers = numbers.get(6 * k * slot.columns..).unwrap_or_default();
                    rows(6, slot.columns, numbers)
                })
            }
        };
        line.insert(output.name().to_owned(), value);
    }
    if answer.warnings.contains(Warnings::NO_LIMIT) {
        line.insert("no_limit".to_owned(), json!(without_limit(model, &asked.query)));
    }
    write(out, line, remark);
}

/// The actuators without a limit that the wanted fields read.
fn without_limit<'a>(model: &'a ModelInfo, query: &Query) -> Vec<&'a String> {
    let wants_force =
        query.want.iter().any(|field| field.is_of_motors() && field != Field::SpeedVertices);
    let has = |limit: Option<f64>| limit.is_some_and(|limit| limit > 0.0);
    let is_limited = |name: &&String| {
        model.limits_of(name).is_some_and(|limits| {
            (has(limits.effort) || !wants_force)
                && (has(limits.velocity) || !query.want.has(Field::SpeedVertices))
        })
    };
    model.active.iter().filter(|name| !is_limited(name)).collect()
}

fn head(status: Status, warnings: &[&str]) -> Map<String, Value> {
    let status = ("status".to_owned(), json!(status.name()));
    Map::from_iter([status, ("warnings".to_owned(), json!(warnings))])
}

/// Writes a line; text and numbers always serialise.
fn write(out: &mut Vec<u8>, mut line: Map<String, Value>, remark: Option<&Remark>) {
    if let Some(Remark { column, words }) = remark {
        line.extend(column.map(|column| ("column".to_owned(), json!(column))));
        line.insert("error".to_owned(), json!(words));
    }
    let _ = serde_json::to_writer(&mut *out, &line);
    out.push(b'\n');
}

/// An object with one object for each asked link; null if a part has no numbers, unless it is that
/// of the actuators, which is null alone: they may not determine the motion.
fn by_link<P: Copy, R: Clone>(
    asked: &Asked,
    parts: &[(&str, Option<P>, R)],
    of: impl Fn(usize, P, R) -> Value,
) -> Value {
    if parts.iter().any(|(name, part, _)| part.is_none() && *name != ACTUATOR) {
        return Value::Null;
    }
    let of_link = |k| {
        let parts = parts.iter();
        parts
            .map(|(name, part, rest)| (*name, part.map(|part| of(k, part, rest.clone()))))
            .collect()
    };
    let links = asked.frames.iter().enumerate();
    links.map(|(k, link)| -> (&str, Value) { (link, of_link(k)) }).collect()
}

/// The numbers of a field: a plain number, a list, or a list of rows; null for NaN and infinities.
fn value(slot: &Slot, numbers: &[f64], model: &ModelInfo, query: &Query) -> Value {
    match slot.field {
        // a count, exact in a double
        Field::Iterations => numbers.first().map(|x| *x as u64).into(),
        field if FIELDS[field as usize].shape == "1" => numbers.first().copied().into(),
        // a sign
        Field::Branch => numbers.iter().map(|x| *x as i64).collect(),
        Field::LambdaDeterminate => numbers.iter().map(|x| *x == 1.0).collect(),
        Field::GoodIndependents => {
            let chosen = model.tree.iter().zip(numbers).filter(|(_, x)| **x == 1.0);
            chosen.map(|(name, _)| name.as_str()).collect()
        }
        // a set of vertices has no others behind the first that is missing
        field if field.has_vertex_rows() => {
            let is_there = |row: &&[f64]| row.iter().all(|x| !x.is_nan());
            match numbers.chunks_exact(slot.columns.max(1)).take_while(is_there).count() {
                0 => Value::Null,
                n => rows(n, slot.columns, numbers),
            }
        }
        Field::Binding | Field::Clip | Field::ClipNearest if numbers.iter().any(|x| x.is_nan()) => {
            Value::Null
        }
        Field::GainsY => {
            let n = slot.columns / 2;
            let row = |k: usize| numbers.get(k * slot.columns..).unwrap_or_default();
            let part = |range: Range<usize>| -> Value {
                (0..slot.rows).map(|k| row(k).get(range.clone()).unwrap_or_default()).collect()
            };
            let force: Value = (0..slot.rows).filter_map(|k| row(k).get(2 * n)).copied().collect();
            json!({"stiffness": part(0..n), "damping": part(n..2 * n), "force": force})
        }
        // without the centre of mass where it has no target
        Field::TaskResidual => numbers.iter().copied().filter(|x| !x.is_nan()).collect(),
        Field::Binding => json!(binding(numbers, &model.tree)),
        Field::ContactForces => {
            let links = query.frames().iter().map(|link| &model.links[usize::from(*link)]);
            let held = links.zip(numbers.chunks_exact(6)).filter(|(_, row)| !row[0].is_nan());
            held.collect()
        }
        Field::Solutions => {
            let found = numbers.chunks(slot.columns.max(1)).take_while(|y| !y[0].is_nan());
            rows(found.count(), slot.columns, numbers)
        }
        Field::Energy => {
            ["kinetic", "potential"].into_iter().zip(numbers.iter().copied()).collect()
        }
        _ if slot.is_matrix() => rows(slot.rows, slot.columns, numbers),
        _ => json!(numbers),
    }
}

/// An exceeded limit.
#[derive(Serialize)]
struct Exceeded<'a> {
    name: &'a str,
    what: &'static str,
    /// Of a force without `tau_u` it is not known.
    value: Option<f64>,
    lower: Option<f64>,
    upper: Option<f64>,
}

/// The exceeded limits; `numbers` holds the excess over each one, 0 within it.
fn exceeded<'a>(
    numbers: &[f64],
    model: &'a ModelInfo,
    rows: &Rows,
    forces: Option<&[f64]>,
) -> Vec<Exceeded<'a>> {
    let force = |name: &String| {
        let row = rows.u.iter().position(|u| model.active.get(*u) == Some(name))?;
        forces?.get(row).copied()
    };
    let mut found = Vec::new();
    for (v, excess) in rows.v.iter().zip(numbers.chunks_exact(3)) {
        let Some((name, Some(limits))) = model.tree.get(*v).zip(model.limits.get(*v)) else {
            continue;
        };
        for ((what, mut lower, mut upper), excess) in limits.ranges().into_iter().zip(excess) {
            let side = if *excess < 0.0 { &mut lower } else { &mut upper };
            let (Some(bound), true) = (*side, *excess != 0.0) else { continue };
            let value = if what == "effort" { force(name) } else { Some(bound + excess) };
            // a motor's limit at this speed is less than its largest one
            *side = value.map(|x| x - excess).filter(|at| (at - bound).abs() > SAME * bound.abs());
            *side = side.or(Some(bound));
            found.push(Exceeded { name, what, value, lower, upper });
        }
    }
    found
}

/// The names of active bounds: those of joints, and `clearance`.
fn binding<'a>(numbers: &[f64], names: &'a [String]) -> Vec<&'a str> {
    let names = names.iter().map(String::as_str).chain(["clearance"]);
    let rows = names.zip(numbers.chunks_exact(3));
    rows.filter(|(_, row)| row.iter().any(|x| *x != 0.0)).map(|(name, _)| name).collect()
}

fn rows(n_rows: usize, columns: usize, numbers: &[f64]) -> Value {
    let row = |k: usize| numbers.get(k * columns..(k + 1) * columns).unwrap_or_default();
    (0..n_rows).map(row).collect()
}

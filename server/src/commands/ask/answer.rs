//! One line out.

use sarrus_client::{Answer, Field, Layout, ModelInfo, Query, Status, Warnings};
use sarrus_proto::{FIELDS, Rows, Slot};
use serde::Serialize;

use super::request::{Asked, Output};

/// The Jacobian of the actuators in the object of a link.
const ACTUATOR: &str = "actuator";

/// The reason why there are no numbers, and the column of the fault if it has one.
pub(super) struct Remark {
    pub(super) column: Option<usize>,
    pub(super) words: String,
}

/// The answer to an invalid line.
pub(super) fn bad_request(out: &mut Vec<u8>, remark: &Remark) {
    head(out, Status::BadRequest, &[]);
    foot(out, Some(remark));
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
    head(out, answer.status, &names);
    let part = |field| {
        let slot = layout.slot(field)?;
        let numbers = numbers.get(slot.range())?;
        // only few fields of a failed answer are valid
        let is_valid = matches!(answer.status, Status::Ok | Status::NotReached)
            || field.survives_failure() && numbers.iter().all(|number| number.is_finite());
        is_valid.then_some((slot, numbers))
    };
    for output in &asked.outputs {
        key(out, output.name(), false);
        match output {
            Output::Field(field) => match part(*field) {
                Some((slot, numbers)) => value(out, slot, numbers, model, &asked.query),
                None => null(out),
            },
            Output::Frames => {
                let parts = [
                    ("p", Field::FramePose, 0..3),
                    ("quat", Field::FramePose, 3..7),
                    ("twist", Field::FrameTwist, 0..6),
                    ("acc", Field::FrameAcc, 0..6),
                ];
                let parts = parts.map(|(name, field, range)| (name, part(field), range));
                by_link(out, asked, &parts, |out, k, (slot, numbers), range| {
                    let numbers = numbers.iter().skip(k * slot.columns + range.start);
                    list(out, numbers.take(range.len()), number);
                });
            }
            Output::Jacobians => {
                let parts = [
                    ("tree", Field::JacobianTree),
                    ("independent", Field::JacobianIndependent),
                    (ACTUATOR, Field::JacobianActuator),
                ];
                let parts = parts.map(|(name, field)| (name, part(field), ()));
                by_link(out, asked, &parts, |out, k, (slot, numbers), ()| {
                    let numbers = numbers.get(6 * k * slot.columns..).unwrap_or_default();
                    rows(out, 6, slot.columns, numbers);
                });
            }
        }
    }
    if answer.warnings.contains(Warnings::NO_LIMIT) {
        key(out, "no_limit", false);
        write(out, &without_limit(model, &asked.query));
    }
    foot(out, remark);
}

/// The actuators without a limit that the wanted fields read.
fn without_limit<'a>(model: &'a ModelInfo, query: &Query) -> Vec<&'a String> {
    let wants_force =
        query.want.iter().any(|field| field.is_of_motors() && field != Field::SpeedVertices);
    let has = |limit: Option<f64>| limit.is_some_and(|limit| limit > 0.0);
    let is_limited = |name: &&String| {
        let at = model.tree.iter().position(|joint| joint == *name);
        let limits = at.and_then(|v| model.limits.get(v).copied().flatten());
        limits.is_some_and(|limits| {
            (has(limits.effort) || !wants_force)
                && (has(limits.velocity) || !query.want.has(Field::SpeedVertices))
        })
    };
    model.active.iter().filter(|name| !is_limited(name)).collect()
}

fn head(out: &mut Vec<u8>, status: Status, warnings: &[&str]) {
    out.push(b'{');
    key(out, "status", true);
    write(out, status.name());
    key(out, "warnings", false);
    write(out, warnings);
}

fn foot(out: &mut Vec<u8>, remark: Option<&Remark>) {
    if let Some(remark) = remark {
        if let Some(column) = remark.column {
            key(out, "column", false);
            write(out, &column);
        }
        key(out, "error", false);
        write(out, &remark.words);
    }
    out.extend_from_slice(b"}\n");
}

/// An object with one object for each asked link; null if a part has no numbers, unless it is that
/// of the actuators, which is null alone: they may not determine the motion.
fn by_link<P: Copy, R: Clone>(
    out: &mut Vec<u8>,
    asked: &Asked,
    parts: &[(&str, Option<P>, R)],
    mut write_part: impl FnMut(&mut Vec<u8>, usize, P, R),
) {
    if parts.iter().any(|(name, part, _)| part.is_none() && *name != ACTUATOR) {
        return null(out);
    }
    out.push(b'{');
    for (k, link) in asked.frames.iter().enumerate() {
        key(out, link, k == 0);
        out.push(b'{');
        for (i, (name, part, rest)) in parts.iter().enumerate() {
            key(out, name, i == 0);
            match part {
                Some(part) => write_part(out, k, *part, rest.clone()),
                None => null(out),
            }
        }
        out.push(b'}');
    }
    out.push(b'}');
}

/// The numbers of a field: a plain number, a list, or a list of rows.
fn value(out: &mut Vec<u8>, slot: &Slot, numbers: &[f64], model: &ModelInfo, query: &Query) {
    match slot.field {
        // a count, exact in a double
        Field::Iterations => numbers.iter().for_each(|x| write(out, &(*x as u64))),
        field if FIELDS[field as usize].shape == "1" => numbers.iter().for_each(|x| number(out, x)),
        // a sign
        Field::Branch => list(out, numbers.iter(), |out, x| write(out, &(*x as i64))),
        Field::LambdaDeterminate => list(out, numbers.iter(), |out, x| write(out, &(*x == 1.0))),
        Field::GoodIndependents => list(out, chosen(numbers, &model.tree), write),
        Field::Limits => write(out, &exceeded(numbers, model, &Rows::of(query, model).v)),
        // a set of vertices has no others behind the first that is missing
        field if field.has_vertex_rows() => {
            let is_there = |row: &&[f64]| row.iter().all(|x| !x.is_nan());
            match numbers.chunks_exact(slot.columns.max(1)).take_while(is_there).count() {
                0 => null(out),
                n => rows(out, n, slot.columns, numbers),
            }
        }
        Field::Binding | Field::Clip | Field::ClipNearest if numbers.iter().any(|x| x.is_nan()) => {
            null(out)
        }
        Field::GainsY => {
            let n = slot.columns / 2;
            let row = |k: usize| numbers.get(k * slot.columns..).unwrap_or_default();
            out.push(b'{');
            for (name, range) in [("stiffness", 0..n), ("damping", n..2 * n)] {
                key(out, name, range.start == 0);
                list(out, 0..slot.rows, |out, k| {
                    list(out, row(k).get(range.clone()).unwrap_or_default(), number);
                });
            }
            key(out, "force", false);
            list(out, (0..slot.rows).filter_map(|k| row(k).get(2 * n)), number);
            out.push(b'}');
        }
        // without the centre of mass where it has no target
        Field::TaskResidual => list(out, numbers.iter().filter(|x| !x.is_nan()), number),
        Field::Binding => write(out, &binding(numbers, &model.tree)),
        Field::ContactForces => contact_forces(out, numbers, model, query),
        Field::Solutions => {
            let found = numbers.chunks(slot.columns.max(1)).take_while(|y| !y[0].is_nan());
            rows(out, found.count(), slot.columns, numbers);
        }
        Field::Energy => {
            out.push(b'{');
            for (k, (name, x)) in ["kinetic", "potential"].iter().zip(numbers).enumerate() {
                key(out, name, k == 0);
                number(out, x);
            }
            out.push(b'}');
        }
        _ if slot.is_matrix() => rows(out, slot.rows, slot.columns, numbers),
        _ => list(out, numbers.iter(), number),
    }
}

/// An exceeded limit.
#[derive(Serialize)]
struct Exceeded<'a> {
    name: &'a str,
    what: &'static str,
    value: f64,
    lower: Option<f64>,
    upper: Option<f64>,
}

/// The exceeded limits; `numbers` holds the excess over each one, 0 within it.
fn exceeded<'a>(numbers: &[f64], model: &'a ModelInfo, velocities: &[usize]) -> Vec<Exceeded<'a>> {
    let mut found = Vec::new();
    for (v, excess) in velocities.iter().zip(numbers.chunks_exact(3)) {
        let Some((name, Some(limits))) = model.tree.get(*v).zip(model.limits.get(*v)) else {
            continue;
        };
        for ((what, lower, upper), excess) in limits.ranges().into_iter().zip(excess) {
            let bound = if *excess < 0.0 { lower } else { upper };
            if let (Some(bound), true) = (bound, *excess != 0.0) {
                found.push(Exceeded { name, what, value: bound + excess, lower, upper });
            }
        }
    }
    found
}

/// The wrench on each held frame, as a line's `wrenches`.
fn contact_forces(out: &mut Vec<u8>, numbers: &[f64], model: &ModelInfo, query: &Query) {
    let links = query.frames().iter().map(|link| &model.links[usize::from(*link)]);
    let rows = links.zip(numbers.chunks_exact(6)).filter(|(_, row)| !row[0].is_nan());
    out.push(b'{');
    for (k, (name, row)) in rows.enumerate() {
        key(out, name, k == 0);
        list(out, row.iter(), number);
    }
    out.push(b'}');
}

/// The names of active bounds: those of joints, and `clearance`.
fn binding<'a>(numbers: &[f64], names: &'a [String]) -> Vec<&'a str> {
    let names = names.iter().map(String::as_str).chain(["clearance"]);
    let rows = names.zip(numbers.chunks_exact(3));
    rows.filter(|(_, row)| row.iter().any(|x| *x != 0.0)).map(|(name, _)| name).collect()
}

/// The names whose number is 1.
fn chosen<'a>(numbers: &[f64], names: &'a [String]) -> impl Iterator<Item = &'a String> {
    let chosen: Vec<bool> = numbers.iter().map(|x| *x == 1.0).collect();
    names.iter().zip(chosen).filter(|(_, chosen)| *chosen).map(|(name, _)| name)
}

fn rows(out: &mut Vec<u8>, n_rows: usize, columns: usize, numbers: &[f64]) {
    let row = |k: usize| numbers.get(k * columns..(k + 1) * columns).unwrap_or_default();
    list(out, 0..n_rows, |out, k| list(out, row(k).iter(), number));
}

fn list<I: IntoIterator>(
    out: &mut Vec<u8>,
    items: I,
    mut write_item: impl FnMut(&mut Vec<u8>, I::Item),
) {
    out.push(b'[');
    for (k, item) in items.into_iter().enumerate() {
        if k > 0 {
            out.push(b',');
        }
        write_item(out, item);
    }
    out.push(b']');
}

fn key(out: &mut Vec<u8>, name: &str, first: bool) {
    if !first {
        out.push(b',');
    }
    write(out, name);
    out.push(b':');
}

/// The shortest digits that read back as the same number; null for NaN and infinities.
fn number(out: &mut Vec<u8>, number: &f64) {
    write(out, number);
}

fn null(out: &mut Vec<u8>) {
    out.extend_from_slice(b"null");
}

/// Appends a value; text and numbers always serialise.
fn write<T: Serialize + ?Sized>(out: &mut Vec<u8>, value: &T) {
    let _ = serde_json::to_writer(out, value);
}

//! Queries: prepared once, asked as often as needed.
#![allow(unsafe_code, reason = "functions have names that C can link, and arrays come as pointers")]

use core::ffi::c_char;
use core::mem::MaybeUninit;
use core::num::NonZero;
use std::thread;

use sarrus_client::{Answer, FailedState, Field, Layout, PlanId, Status, Warnings};

use crate::border::{addresses_of, array_beside, arrays, bytes, free, make, put, text, texts};
use crate::failure::{Failure, guarded};
use crate::robot::{Robot, query_options};
use crate::status::StatusCode;

/// A query by names. Begin with zeros, `sarrus_query query = {0};`, and set the members needed.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Query {
    /// A sarrus_request.
    pub request: u32,
    /// Bits of sarrus_query_option.
    pub options: u32,
    /// The fields that each request gives, such as "y".
    pub given: *const *const c_char,
    /// How many.
    pub n_given: usize,
    /// The fields that each answer holds, such as "tau_u"; none stands for the request's usual
    /// ones.
    pub want: *const *const c_char,
    /// How many.
    pub n_want: usize,
    /// The links whose frames are asked; `want` selects the fields of frames.
    pub frames: *const *const c_char,
    /// How many.
    pub n_frames: usize,
    /// The links that wrenches act on; adds "wrenches" to the given fields.
    pub wrenches: *const *const c_char,
    /// How many.
    pub n_wrenches: usize,
    /// The joints whose rows are asked, by names with * ? [...] as in shells; none stands for all.
    pub joints: *const *const c_char,
    /// How many.
    pub n_joints: usize,
    /// How far redundant rows of loops may be open before an answer has the warning loop_open, in
    /// radians or lengths of the cluster; NULL for 1e-6.
    pub loop_tolerance: *const f64,
    /// How far an answer may be from the q or qd that was given before it has the warning
    /// input_projected; NULL for 1e-6.
    pub projection_tolerance: *const f64,
    /// The link that takes the root's place for frames; NULL for the root.
    pub relative_to: *const c_char,
    /// A sarrus_axes: axes and reference point of twists, accelerations and Jacobians of frames.
    pub axes: u32,
    /// Number of given directions of supports; adds "directions" to the given fields.
    pub n_directions: u32,
    /// Of requests with tasks, from SARRUS_REQUEST_INVERSE_KINEMATICS on, for each of `frames` bits
    /// of sarrus_task_part; adds "task_target" to the given fields of that one, "task_motion" to
    /// those of the others. NULL for other requests.
    pub tasks: *const u8,
    /// Zeros, for members of later versions; other values are refused.
    pub reserved: [u64; 5],
}

/// A prepared query of one robot, with the layouts of its input and output. It belongs to the robot
/// that prepared it and to no other, even of the same model. Freeing it frees this memory alone;
/// sarrus_robot_release releases the plan in the robot and its server.
pub struct Plan {
    id: PlanId,
    given: Layout,
    want: Layout,
}

/// Where a field lies among the numbers that go in or come out.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Slot {
    /// Place of its first number.
    pub offset: usize,
    /// Rows.
    pub rows: usize,
    /// Columns; a matrix is packed row by row.
    pub columns: usize,
}

/// The plan as a handle of its own.
pub(crate) fn handle(robot: &Robot, id: PlanId) -> Result<Plan, Failure> {
    let prepared = robot.robot.plan(id).ok_or(Failure::Ask(sarrus_client::Error::ReleasedPlan))?;
    Ok(Plan { id, given: prepared.given().clone(), want: prepared.want().clone() })
}

/// A bound that may be left out.
///
/// # Safety
/// It is NULL or as [`arrays`] needs a single number.
unsafe fn tolerance(name: &'static str, bound: *const f64, usual: f64) -> Result<f64, Failure> {
    if bound.is_null() {
        return Ok(usual);
    }
    // SAFETY: this function's own condition.
    let ([numbers], []) = unsafe { arrays([(name, bound, 1)], [])? };
    Ok(numbers.first().copied().unwrap_or(usual))
}

/// Prepares a query; equal queries of a robot share one plan. Allocates. All names that stand for
/// nothing are reported together. The plan is freed by
/// sarrus_plan_free.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_prepare(
    robot: Option<&mut Robot>,
    query: Option<&Query>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    make("plan", plan, || {
        let robot = robot.ok_or(Failure::Null("robot"))?;
        let query = query.ok_or(Failure::Null("query"))?;
        let request = sarrus_client::Request::from_code(query.request)
            .ok_or(Failure::Number("request", query.request))?;
        let mut builder = robot.robot.query(request);
        macro_rules! names {
            ($($list:ident: $count:ident),*) => {$(
                // SAFETY: the header states the requirements on the texts.
                let names = unsafe { texts(stringify!($list), query.$list, query.$count)? };
                if !names.is_empty() {
                    builder = builder.$list(names);
                }
            )*};
        }
        names!(given: n_given, want: n_want, frames: n_frames);
        if !query.tasks.is_null() {
            // SAFETY: the header states the requirements on the texts and the bytes.
            let (links, parts) = unsafe {
                (
                    texts("frames", query.frames, query.n_frames)?,
                    bytes("tasks", query.tasks.cast(), query.n_frames)?,
                )
            };
            let parts = parts.iter().map(|bits| sarrus_client::TaskParts(*bits));
            builder = builder.tasks(links.into_iter().zip(parts));
        }
        names!(wrenches: n_wrenches, joints: n_joints);
        if let Some(word) = query.reserved.iter().find(|word| **word != 0) {
            return Err(Failure::Number("reserved", *word as u32));
        }
        let options = query_options(query.options)?;
        let axes = sarrus_client::Axes::from_code(query.axes)
            .ok_or(Failure::Number("axes", query.axes))?;
        builder = builder.axes(axes).options(options);
        if query.n_directions > 0 {
            builder = builder.directions(query.n_directions as usize);
        }
        if !query.relative_to.is_null() {
            // SAFETY: the header states the requirements on the texts.
            let link = unsafe { texts("relative_to", &query.relative_to, 1)? };
            builder = link.iter().fold(builder, |builder, link| builder.relative_to(link));
        }
        // SAFETY: by the header each bound is NULL or points to a number.
        let (loops, projection) = unsafe {
            let usual = builder.query().loop_tolerance.bound();
            (
                tolerance("loop_tolerance", query.loop_tolerance, usual)?,
                tolerance("projection_tolerance", query.projection_tolerance, usual)?,
            )
        };
        builder = builder.loop_tolerance(loops).projection_tolerance(projection);
        let id = builder.prepare()?;
        handle(robot, id)
    })
}

/// How many numbers go in; 0 for NULL.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_plan_inputs(plan: Option<&Plan>) -> usize {
    plan.map_or(0, |plan| plan.given.len())
}

/// How many numbers come out; 0 for NULL.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_plan_outputs(plan: Option<&Plan>) -> usize {
    plan.map_or(0, |plan| plan.want.len())
}

/// Writes where a field lies.
///
/// # Safety
/// The name is as [`text`] needs it.
unsafe fn slot(
    layout: &Layout,
    name: *const c_char,
    place: Option<&mut MaybeUninit<Slot>>,
) -> Result<(), Failure> {
    let place = place.ok_or(Failure::Null("slot"))?;
    // SAFETY: this function's own condition.
    let name = unsafe { text("field", name)? };
    let found = Field::from_name(name).and_then(|field| layout.slot(field));
    let found = found.ok_or_else(|| Failure::NoField(name.to_owned()))?;
    place.write(Slot { offset: found.offset, rows: found.rows, columns: found.columns });
    Ok(())
}

/// Where a given field lies in the input. Fields are packed in a fixed order, independent of the
/// order of their names in the query.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_plan_given(
    plan: Option<&Plan>,
    field: *const c_char,
    place: Option<&mut MaybeUninit<Slot>>,
) -> StatusCode {
    guarded(|| {
        let plan = plan.ok_or(Failure::Null("plan"))?;
        // SAFETY: the header states the requirements on the text.
        unsafe { slot(&plan.given, field, place) }
    })
}

/// Where a wanted field lies in the output.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_plan_want(
    plan: Option<&Plan>,
    field: *const c_char,
    place: Option<&mut MaybeUninit<Slot>>,
) -> StatusCode {
    guarded(|| {
        let plan = plan.ok_or(Failure::Null("plan"))?;
        // SAFETY: the header states the requirements on the text.
        unsafe { slot(&plan.want, field, place) }
    })
}

/// Asks: `input` holds the given fields, `output` gets the wanted ones, both packed in the plan's
/// layout. In process and through a lane it never allocates. After any status other than
/// SARRUS_STATUS_OK the outputs that survive a failure keep their numbers and all others are NaN;
/// pointers that cannot be used leave them as they were. `warnings` gets bits of sarrus_warning,
/// and may be NULL.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_ask(
    robot: Option<&mut Robot>,
    plan: Option<&Plan>,
    input: *const f64,
    n_input: usize,
    output: *mut f64,
    n_output: usize,
    warnings: Option<&mut MaybeUninit<u32>>,
) -> StatusCode {
    guarded(|| {
        // SAFETY: the header states the requirements on the arrays.
        let ([input], [output]) =
            unsafe { arrays([("input", input, n_input)], [("output", output, n_output)])? };
        let robot = robot.ok_or(Failure::Null("robot"))?;
        let plan = plan.ok_or(Failure::Null("plan"))?;
        let answer = robot.robot.ask(plan.id, input, output)?;
        put(warnings, answer.warnings.0);
        answer.ok()?;
        Ok(())
    })
}

/// Asks for rows of states: `input` and `output` hold those of all rows, one after the other, each
/// packed in the plan's layout. Every number, status and warning is that of sarrus_robot_ask, to
/// the bit. In process `threads` threads work, the calling one among them, 0 standing for one on
/// each processor; a connected robot's server answers them. `statuses` and `warnings` get a number
/// for each row, and may be NULL. All rows are answered; the status of the call is that of the
/// first row without an answer. Where the call fails as a whole, rows that were not answered have
/// its status, and NaN for numbers. Allocates.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_batch(
    robot: Option<&mut Robot>,
    plan: Option<&Plan>,
    threads: usize,
    rows: usize,
    input: *const f64,
    n_input: usize,
    output: *mut f64,
    n_output: usize,
    statuses: *mut i32,
    warnings: *mut u32,
) -> StatusCode {
    guarded(|| {
        // SAFETY: the header states the requirements on the arrays.
        let ([input], [output]) =
            unsafe { arrays([("input", input, n_input)], [("output", output, n_output)])? };
        let mut others = vec![("input", addresses_of(input)), ("output", addresses_of(output))];
        // SAFETY: as above.
        let statuses = unsafe { array_beside("statuses", statuses, rows, &others)? };
        others.push(("statuses", addresses_of(statuses)));
        // SAFETY: as above.
        let warnings = unsafe { array_beside("warnings", warnings, rows, &others)? };
        let robot = robot.ok_or(Failure::Null("robot"))?;
        let plan = plan.ok_or(Failure::Null("plan"))?;
        // before memory is taken for so many rows
        let fits = |numbers: &[f64], layout: &Layout| {
            rows.checked_mul(layout.len()).is_some_and(|n| n == numbers.len())
        };
        let is_empty = rows > 0 && plan.given.is_empty() && plan.want.is_empty();
        let none = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut answers = Vec::new();
        let refused = if is_empty || !fits(input, &plan.given) || !fits(output, &plan.want) {
            Some(FailedState { status: Status::WrongSize }.into())
        } else {
            let reserved = answers.try_reserve_exact(rows);
            reserved.err().map(|_| Failure::NoMemory("the statuses of so many rows"))
        };
        if let Some(failure) = refused {
            output.fill(f64::NAN);
            statuses.fill(failure.status().0);
            warnings.fill(0);
            return Err(failure);
        }
        answers.resize(rows, none);
        let threads = NonZero::new(threads).or_else(|| thread::available_parallelism().ok());
        let threads = threads.unwrap_or(NonZero::<usize>::MIN);
        let outcome = robot.robot.batch(plan.id, threads, input, output, &mut answers);
        // if the call failed, the rows without an answer
        let unasked = outcome.as_ref().err().map(|error| StatusCode::of_error(error).0);
        for (status, answer) in statuses.iter_mut().zip(&answers) {
            *status = match (answer.status, unasked) {
                (Status::UnknownRequest, Some(unasked)) => unasked,
                (status, _) => status as i32,
            };
        }
        for (warnings, answer) in warnings.iter_mut().zip(&answers) {
            *warnings = answer.warnings.0;
        }
        outcome?;
        Ok(answers.iter().try_for_each(|answer| answer.ok().map(drop))?)
    })
}

/// Releases a plan: its resources here and in the server are freed once it was released as often as
/// it was prepared. Its handle is still to be freed, by sarrus_plan_free.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_release(
    robot: Option<&mut Robot>,
    plan: Option<&Plan>,
) -> StatusCode {
    guarded(|| {
        let robot = robot.ok_or(Failure::Null("robot"))?;
        let plan = plan.ok_or(Failure::Null("plan"))?;
        Ok(robot.robot.release(plan.id)?)
    })
}

/// Frees the memory of a plan handle, before or after its robot; NULL does nothing.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_plan_free(plan: Option<Box<Plan>>) {
    free(plan);
}

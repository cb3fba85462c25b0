//! Robots: made, connected, described, freed.
#![allow(unsafe_code, reason = "functions have names that C can link, and texts come as pointers")]

use core::ffi::c_char;
use core::mem::MaybeUninit;
use core::ptr::null;
use std::ffi::CString;

use sarrus_client::{QueryOptions, Source};

use crate::border::{bytes, free, make, put, text, text_or_none};
use crate::failure::{Failure, guarded};
use crate::options::{Connecting, LoadOptions, connecting, loading};
use crate::status::StatusCode;

/// A robot that answers: in this process or in another, by the same functions and with the same
/// bits. One thread uses it at a time; any may.
pub struct Robot {
    pub(crate) robot: sarrus_client::Robot,
    pub(crate) name: CString,
    /// By the numbers of [`crate::model::Order`].
    pub(crate) names: [Box<[CString]>; 9],
}

/// How long the last answer took.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Times {
    /// How old the request was when the server took it [ns]; 0 in process.
    pub age_ns: u32,
    /// From then to the publication of the answer [ns].
    pub took_ns: u32,
}

impl Robot {
    fn new(robot: sarrus_client::Robot) -> Robot {
        let model = robot.model();
        let names = [
            &model.tree,
            &model.tree_q,
            &model.independent,
            &model.independent_q,
            &model.active,
            &model.loops,
            &model.branches,
            &model.links,
            &model.warnings,
        ];
        // no file can have a zero inside a name; it would leave the name empty
        let kept = |name: &String| CString::new(name.as_str()).unwrap_or_default();
        let names = names.map(|list| list.iter().map(kept).collect());
        Robot { name: kept(&model.robot), names, robot }
    }

    fn load(source: &Source, options: &sarrus_client::Options) -> Result<Robot, Failure> {
        Ok(Robot::new(sarrus_client::Robot::load(source, options).map_err(Failure::Load)?))
    }
}

/// Loads a bundled robot, such as "lambda", into this process. `options` may be NULL. The robot is
/// freed by sarrus_robot_free; `*robot` is NULL after a failure.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_bundled(
    name: *const c_char,
    options: Option<&LoadOptions>,
    robot: Option<&mut MaybeUninit<Option<Box<Robot>>>>,
) -> StatusCode {
    make("robot", robot, || {
        // SAFETY: the header states the requirements on the texts.
        let (name, options) = unsafe { (text("name", name)?, loading(options)?) };
        Robot::load(&Source::Bundled(name.to_owned()), &options)
    })
}

/// Loads a robot from files into this process: a URDF, or a SMURF file that names one, and its
/// submechanisms, which may be NULL. After SARRUS_STATUS_LOAD_FAILED the text has a line for each
/// fault.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_load(
    urdf: *const c_char,
    submechanisms: *const c_char,
    options: Option<&LoadOptions>,
    robot: Option<&mut MaybeUninit<Option<Box<Robot>>>>,
) -> StatusCode {
    make("robot", robot, || {
        // SAFETY: the header states the requirements on the texts.
        let (urdf, submechanisms, options) = unsafe {
            (
                text("urdf", urdf)?.into(),
                text_or_none("submechanisms", submechanisms)?.map(Into::into),
                loading(options)?,
            )
        };
        Robot::load(&Source::Files { urdf, submechanisms }, &options)
    })
}

/// Loads a robot from the contents of files, with their lengths in bytes; `submechanisms` may be
/// NULL.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_load_text(
    urdf: *const c_char,
    urdf_size: usize,
    submechanisms: *const c_char,
    submechanisms_size: usize,
    options: Option<&LoadOptions>,
    robot: Option<&mut MaybeUninit<Option<Box<Robot>>>>,
) -> StatusCode {
    make("robot", robot, || {
        let is_there = !submechanisms.is_null();
        // SAFETY: the header states the requirements on the texts.
        let (urdf, submechanisms, options) = unsafe {
            (
                bytes("urdf", urdf, urdf_size)?,
                bytes("submechanisms", submechanisms, submechanisms_size)?,
                loading(options)?,
            )
        };
        let submechanisms = is_there.then(|| submechanisms.to_vec());
        Robot::load(&Source::Text { urdf: urdf.to_vec(), submechanisms }, &options)
    })
}

/// Connects to a server on this machine, of this user or below the folder that SARRUS_ROOT names.
/// `options` may be NULL. When the server is killed and started again with the same model, the
/// robot goes on by itself, plans included.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_connect(
    name: *const c_char,
    options: Option<&Connecting>,
    robot: Option<&mut MaybeUninit<Option<Box<Robot>>>>,
) -> StatusCode {
    make("robot", robot, || {
        // SAFETY: the header states the requirements on the text.
        let name = unsafe { text("name", name)? };
        let options = connecting(options)?;
        Ok(Robot::new(sarrus_client::Robot::connect_with(name, options)?))
    })
}

/// Frees a robot, and its plans with it; NULL does nothing.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_robot_free(robot: Option<Box<Robot>>) {
    free(robot);
}

/// Name of the robot, which lives as long as it; NULL for NULL.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_robot_name(robot: Option<&Robot>) -> *const c_char {
    robot.map_or(null(), |robot| robot.name.as_ptr())
}

/// A number that differs whenever any name, order or constant of the model differs; 0 for NULL.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_robot_fingerprint(robot: Option<&Robot>) -> u64 {
    robot.map_or(0, |robot| robot.robot.model().fingerprint)
}

/// Has every simple call from now on (sarrus_robot_inverse_dynamics and those beside it) carry a
/// checksum, times or both: bits of sarrus_query_option. The next call of each prepares its plan.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_set_options(robot: Option<&mut Robot>, options: u32) -> StatusCode {
    guarded(|| {
        let robot = robot.ok_or(Failure::Null("robot"))?;
        robot.robot.set_options(query_options(options)?);
        Ok(())
    })
}

/// Bits of options as the client has them.
pub(crate) fn query_options(bits: u32) -> Result<QueryOptions, Failure> {
    let options = QueryOptions(bits.into());
    if options.is_known() { Ok(options) } else { Err(Failure::Number("query option", bits)) }
}

/// How long the last answer took, where that was asked; false where it was not, or no answer came.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_robot_times(
    robot: Option<&Robot>,
    times: Option<&mut MaybeUninit<Times>>,
) -> bool {
    match robot.and_then(|robot| robot.robot.times()) {
        Some(found) => {
            put(times, Times { age_ns: found.age_ns, took_ns: found.took_ns });
            true
        }
        None => false,
    }
}

/// Answers that came after the deadline of the connection; 0 in process.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_robot_late(robot: Option<&Robot>) -> u64 {
    robot.map_or(0, |robot| robot.robot.late())
}

//! The controller's and the observer's side of a CAN bridge.
#![allow(unsafe_code, reason = "functions have names that C can link, and texts come as pointers")]

use core::ffi::c_char;
use core::mem::MaybeUninit;
use core::ptr::null;

use sarrus_client::actuators::{
    ActuatorCommand, ActuatorState, MAX_ACTUATORS, MechanismState, Operation, Reason,
};

use crate::border::{free, make, put, text};
use crate::failure::{Failure, guarded};
use crate::status::StatusCode;

/// Asks a bridge for an operation through a handle of the caller.
macro_rules! operate {
    ($handle:ident.$ask:ident($operation:ident $(, $actuator:ident)?), $stamp_ns:ident) => {
        guarded(|| {
            let handle = $handle.ok_or(Failure::Null(stringify!($handle)))?;
            let operation = Operation::from_code($operation);
            let operation = operation.ok_or(Failure::Number("operation", $operation))?;
            put($stamp_ns, handle.0.$ask(operation $(, $actuator)?));
            Ok(())
        })
    };
}

/// The controller of a bridge; a bridge has one at a time. Commands must keep coming: each later
/// than T1 of the configuration is damped, and later than T2 disabled. One thread uses it at a
/// time; any may.
pub struct Controller(sarrus_client::Controller);

/// An observer of a bridge, which may also operate it. One thread uses it at a time; any may.
pub struct Observer(sarrus_client::Observer);

/// Connects to a running bridge, with the fingerprint of the model that commands are computed with:
/// sarrus_robot_fingerprint, or 0 where the bridge has none. Freed by sarrus_controller_free.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_controller_connect(
    name: *const c_char,
    fingerprint: u64,
    controller: Option<&mut MaybeUninit<Option<Box<Controller>>>>,
) -> StatusCode {
    make("controller", controller, || {
        // SAFETY: the header states the requirements on the text.
        let name = unsafe { text("name", name)? };
        Ok(Controller(sarrus_client::Controller::connect(name, fingerprint)?))
    })
}

/// Sends a command, which begins with zeros; its sequence, stamp and fingerprint are filled in.
/// SARRUS_STATUS_NOT_SENT where it could not be sent. Never allocates.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_controller_send(
    controller: Option<&mut Controller>,
    command: Option<&mut ActuatorCommand>,
) -> StatusCode {
    guarded(|| {
        let controller = controller.ok_or(Failure::Null("controller"))?;
        let command = command.ok_or(Failure::Null("command"))?;
        if command.n_u > MAX_ACTUATORS as u64 {
            let found = u32::try_from(command.n_u).unwrap_or(u32::MAX);
            return Err(Failure::Number("count of actuators", found));
        }
        if controller.0.send(command) { Ok(()) } else { Err(Failure::NotSent) }
    })
}

/// The newest state of the actuators, once: SARRUS_STATUS_NOTHING_NEW until there is another. One
/// whose stamp is older than a few cycles means that the bridge is gone.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_controller_state(
    controller: Option<&Controller>,
    state: Option<&mut MaybeUninit<ActuatorState>>,
) -> StatusCode {
    guarded(|| {
        let controller = controller.ok_or(Failure::Null("controller"))?;
        let place = state.ok_or(Failure::Null("state"))?;
        place.write(controller.0.state().ok_or(Failure::NothingNew)?);
        Ok(())
    })
}

/// Asks the bridge for a sarrus_operation. `stamp_ns` gets the time of asking [ns], after which
/// states may show it, and may be NULL. Stay until one does, and ask again: a bridge that does not
/// know of this program yet does not hear it.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_controller_operate(
    controller: Option<&Controller>,
    operation: u32,
    stamp_ns: Option<&mut MaybeUninit<u64>>,
) -> StatusCode {
    operate!(controller.operate(operation), stamp_ns)
}

/// Requests an operation of the mechanism that an actuator acts on, by its place in u.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_controller_operate_mechanism(
    controller: Option<&Controller>,
    operation: u32,
    actuator: usize,
    stamp_ns: Option<&mut MaybeUninit<u64>>,
) -> StatusCode {
    operate!(controller.operate_mechanism(operation, actuator), stamp_ns)
}

/// Frees a controller: its motors are damped after T1, and without power after T2; NULL does
/// nothing.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_controller_free(controller: Option<Box<Controller>>) {
    free(controller);
}

/// Connects to a running bridge, to watch it. Freed by sarrus_observer_free.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_observer_connect(
    name: *const c_char,
    observer: Option<&mut MaybeUninit<Option<Box<Observer>>>>,
) -> StatusCode {
    make("observer", observer, || {
        // SAFETY: the header states the requirements on the text.
        let name = unsafe { text("name", name)? };
        Ok(Observer(sarrus_client::Observer::connect(name)?))
    })
}

/// The newest state of the actuators, once: SARRUS_STATUS_NOTHING_NEW until there is another. One
/// whose stamp is older than a few cycles means that the bridge is gone.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_observer_state(
    observer: Option<&Observer>,
    state: Option<&mut MaybeUninit<ActuatorState>>,
) -> StatusCode {
    guarded(|| {
        let observer = observer.ok_or(Failure::Null("observer"))?;
        let place = state.ok_or(Failure::Null("state"))?;
        place.write(observer.0.state().ok_or(Failure::NothingNew)?);
        Ok(())
    })
}

/// Asks the bridge for a sarrus_operation. `stamp_ns` gets the time of asking [ns], after which
/// states may show it, and may be NULL. Stay until one does, and ask again: a bridge that does not
/// know of this program yet does not hear it.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_observer_operate(
    observer: Option<&Observer>,
    operation: u32,
    stamp_ns: Option<&mut MaybeUninit<u64>>,
) -> StatusCode {
    operate!(observer.operate(operation), stamp_ns)
}

/// Requests an operation of the mechanism that an actuator acts on, by its place in u.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_observer_operate_mechanism(
    observer: Option<&Observer>,
    operation: u32,
    actuator: usize,
    stamp_ns: Option<&mut MaybeUninit<u64>>,
) -> StatusCode {
    operate!(observer.operate_mechanism(operation, actuator), stamp_ns)
}

/// Frees an observer; NULL does
/// nothing.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_observer_free(observer: Option<Box<Observer>>) {
    free(observer);
}

/// CLOCK_MONOTONIC, which all processes of a machine share and stamps are in [ns].
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_now_ns() -> u64 {
    sarrus_client::now_ns()
}

/// Name of a sarrus_mechanism_state; NULL for a number that is none. Lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_mechanism_state_name(state: u32) -> *const c_char {
    MechanismState::from_code(state).map_or(null(), MechanismState::c_name)
}

/// Name of a sarrus_reason; NULL for a number that is none. Lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_reason_name(reason: u32) -> *const c_char {
    Reason::from_code(reason).map_or(null(), Reason::c_name)
}

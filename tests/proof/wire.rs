//! The wire contract number by number, for clients of another build or language.

use std::fs::File;
use std::mem::{align_of, offset_of, size_of};
use std::os::unix::fs::FileExt;

use sarrus_dynamics::{Answer, Field, FieldSet, Layout, Query, Request, Sizes, Status, Warnings};
use sarrus_proto::actuators::{MechanismState, Operation, Reason};
use sarrus_proto::batch::{BATCH_WORDS, BatchHead, BatchShape, ClaimedBatch, ServedBatch};
use sarrus_proto::control::{
    Call, CallHead, ControlRequest, ControlResponse, Grant, Refusal, query_hash,
};
use sarrus_proto::message::PlanNumber;
use sarrus_proto::{ModelInfo, PROTOCOL_VERSION};

#[test]
fn a_query_is_432_bytes_with_its_fields_at_fixed_places() {
    assert_eq!((size_of::<Query>(), align_of::<Query>()), (432, 16));
    let offsets = [
        offset_of!(Query, request),
        offset_of!(Query, n_frames),
        offset_of!(Query, n_wrenches),
        offset_of!(Query, given),
        offset_of!(Query, want),
        offset_of!(Query, options),
        offset_of!(Query, loop_tolerance),
        offset_of!(Query, projection_tolerance),
        offset_of!(Query, frames),
        offset_of!(Query, wrench_links),
        offset_of!(Query, n_joint_runs),
        offset_of!(Query, joints),
        offset_of!(Query, axes),
        offset_of!(Query, relative_to),
        offset_of!(Query, n_directions),
        offset_of!(Query, tasks),
        offset_of!(Query, reserved),
    ];
    assert_eq!(offsets, [0, 4, 6, 16, 32, 48, 56, 64, 72, 136, 168, 172, 296, 300, 304, 312, 344]);
    assert_eq!(
        (size_of::<FieldSet>(), size_of::<Status>(), size_of::<Request>(), size_of::<Field>()),
        (16, 4, 4, 1)
    );
}

#[test]
fn fields_keep_their_numbers_and_names() {
    const NAMES: [&str; 106] = [
        "y",
        "yd",
        "ydd",
        "q",
        "qd",
        "qdd",
        "u",
        "ud",
        "udd",
        "q_guess",
        "qd_guess",
        "tau_q",
        "tau_y",
        "tau_u",
        "wrenches",
        "tau_unactuated",
        "G",
        "g_bias",
        "G_u",
        "g_u",
        "K",
        "k_bias",
        "lambda",
        "M_y",
        "C_y",
        "residual",
        "iterations",
        "cond_Kd",
        "cond_Gu",
        "sigma_min",
        "nearest_y",
        "frame_pose",
        "frame_twist",
        "frame_acc",
        "jacobian_tree",
        "jacobian_independent",
        "jacobian_actuator",
        "cond_My",
        "branch",
        "lambda_determinate",
        "good_independents",
        "uncontrolled",
        "projection",
        "limits",
        "com",
        "com_jacobian",
        "com_bias",
        "momentum",
        "centroidal",
        "energy",
        "Jd_yd",
        "dtau_y_dy",
        "dtau_y_dyd",
        "dtau_u_dy",
        "dtau_u_dyd",
        "dydd_dy",
        "dydd_dyd",
        "dydd_dtau_u",
        "dtau_unactuated_dy",
        "dtau_unactuated_dyd",
        "Gd",
        "dqdd_dy",
        "dg_bias_dyd",
        "djacobian_dy",
        "directions",
        "gains_u",
        "torque_vertices",
        "torque_support",
        "torque_vertices_net",
        "torque_support_net",
        "speed_vertices",
        "reflected_inertia",
        "reflected_damping",
        "reflected_force",
        "gains_y",
        "margin",
        "clip",
        "clip_nearest",
        "binding",
        "dt",
        "gain",
        "observer",
        "tau_external",
        "Lambda",
        "mu",
        "p_task",
        "task_rank",
        "task_target",
        "com_target",
        "bounds_y",
        "bounds_u",
        "clearance",
        "y_guess",
        "y_preferred",
        "task_residual",
        "solutions",
        "task_motion",
        "contact_forces",
        "regressor_y",
        "regressor_u",
        "direction",
        "multipliers",
        "d2_tau_y_v",
        "d2_ydd_v",
        "base_parameters",
        "dgamma_dtheta",
    ];
    assert!(Field::ALL.len() >= NAMES.len(), "a field has gone");
    for (number, (field, name)) in Field::ALL.iter().zip(NAMES).enumerate() {
        assert_eq!((*field as usize, field.name()), (number, name));
        assert_eq!(Field::from_name(name), Some(*field));
        assert_eq!(FieldSet::of(&[*field]).0, 1 << number);
    }
}

#[test]
fn statuses_and_requests_keep_their_numbers_and_names() {
    const NAMES: [&str; 21] = [
        "ok",
        "bad_request",
        "non_finite_input",
        "wrong_size",
        "wrong_model",
        "unknown_request",
        "not_converged",
        "branch_changed",
        "unreachable",
        "singular_closure",
        "singular_independents",
        "singular_actuation",
        "mass_not_positive",
        "overloaded",
        "shutting_down",
        "corrupt_answer",
        "unknown_status",
        "other_process",
        "late",
        "not_reached",
        "infeasible",
    ];
    for (code, name) in NAMES.into_iter().enumerate() {
        assert_eq!(Status::from_code(code as u32).map(Status::name), Some(name));
    }
    let requests = [
        "kinematics",
        "inverse-dynamics",
        "forward-dynamics",
        "map",
        "observe",
        "ik",
        "diff-ik",
        "step",
    ];
    for (code, name) in (1..).zip(requests) {
        assert_eq!(Request::from_code(code).map(Request::name), Some(name));
    }
    assert_eq!((Request::from_code(0), Request::from_code(9)), (None, None));
}

#[test]
fn calls_and_their_answers_keep_their_words() {
    assert_eq!(PROTOCOL_VERSION, 8);
    let head = CallHead { version: PROTOCOL_VERSION, nonce: 7 };
    let text = |call| ControlRequest { head, fingerprint: 1, call }.to_bytes();
    let calls = [
        (Call::Hello, r#""hello""#),
        (Call::Model { page: 3 }, r#"{"model":{"page":3}}"#),
        (Call::Release { plan: PlanNumber(9) }, r#"{"release":{"plan":9}}"#),
        (Call::Lane { n_in: 39, n_out: 13 }, r#"{"lane":{"n_in":39,"n_out":13}}"#),
        (Call::Service, r#""service""#),
        (Call::Serve, r#""serve""#),
        (Call::Batch, r#""batch""#),
        (Call::Leave, r#""leave""#),
        (Call::Statistics, r#""statistics""#),
    ];
    for (call, words) in calls {
        let expected = format!(r#"{{"version":8,"nonce":7,"fingerprint":1,"call":{words}}}"#);
        assert_eq!(String::from_utf8(text(call)).unwrap(), expected);
    }
    let refusals = [
        (Refusal::WrongVersion, r#""wrong_version""#),
        (Refusal::UnknownCall, r#""unknown_call""#),
        (Refusal::WrongModel, r#""wrong_model""#),
        (Refusal::BadQuery { reason: "x".into() }, r#"{"bad_query":{"reason":"x"}}"#),
        (Refusal::TooLarge { n_in: 1, n_out: 2 }, r#"{"too_large":{"n_in":1,"n_out":2}}"#),
        (Refusal::TooManyPlans, r#""too_many_plans""#),
        (
            Refusal::TooManyOrders { process: 7, per_second: 500 },
            r#"{"too_many_orders":{"process":7,"per_second":500}}"#,
        ),
        (Refusal::NoLane { limit: 16 }, r#"{"no_lane":{"limit":16}}"#),
        (Refusal::NoService { limit: 32 }, r#"{"no_service":{"limit":32}}"#),
        (Refusal::NoEnd, r#""no_end""#),
        (Refusal::TooManyClients { limit: 112 }, r#"{"too_many_clients":{"limit":112}}"#),
        (Refusal::NoSpace { needed: 2, free: 1 }, r#"{"no_space":{"needed":2,"free":1}}"#),
        (Refusal::Stopping, r#""stopping""#),
        (Refusal::NoSuchPage, r#""no_such_page""#),
        (Refusal::Failed { reason: "x".into() }, r#"{"failed":{"reason":"x"}}"#),
    ];
    let answer = |outcome| ControlResponse {
        version: PROTOCOL_VERSION,
        nonce: 7,
        query: 0,
        fingerprint: 1,
        instance: 2,
        holder: None,
        outcome,
    };
    for (refusal, words) in refusals {
        let expected = format!(
            r#"{{"version":8,"nonce":7,"query":0,"fingerprint":1,"instance":2,"outcome":{{"Err":{words}}}}}"#
        );
        let bytes = answer(Err(refusal)).to_bytes();
        assert_eq!(String::from_utf8(bytes).unwrap(), expected);
    }
    let plan = Grant::Plan { number: PlanNumber(9), n_in: 39, n_out: 13 };
    assert!(
        String::from_utf8(answer(Ok(plan)).to_bytes())
            .unwrap()
            .ends_with(r#""outcome":{"Ok":{"plan":{"number":9,"n_in":39,"n_out":13}}}}"#)
    );
    let query = Query::new(Request::Kinematics, FieldSet(1), FieldSet(2));
    let other = Query::new(Request::Kinematics, FieldSet(1), FieldSet(3));
    assert_ne!(query_hash(&query), query_hash(&other));
}

#[test]
fn messages_of_version_7_are_refused_and_the_refusal_reads_as_there() {
    let recorded = include_str!("../vectors/wire/version_7.jsonl");
    let (calls, refusal) = recorded.trim_end().rsplit_once('\n').unwrap();
    for (nonce, call) in (1..).zip(calls.lines()) {
        let head = CallHead { version: 7, nonce };
        let read = ControlRequest::from_bytes(call.as_bytes());
        assert_eq!(read, Err((head, Refusal::WrongVersion)), "{call}");
    }
    let response = ControlResponse::from_bytes(refusal.as_bytes()).unwrap();
    assert_eq!((response.version, &response.outcome), (7, &Err(Refusal::WrongVersion)));
    let written = ControlResponse { version: 7, ..response }.to_bytes();
    assert_eq!(String::from_utf8(written).unwrap(), refusal);
}

#[test]
fn every_set_of_fields_travels_unchanged() {
    for bits in [0, 1, u128::from(u64::MAX), 1 << 64, 1 << 127, u128::MAX] {
        let head = CallHead { version: PROTOCOL_VERSION, nonce: 1 };
        let query = Query::new(Request::Map, FieldSet(bits), FieldSet(!bits));
        let call = Call::Plan { query: Box::new(query) };
        let request = ControlRequest { head, fingerprint: 1, call };
        assert_eq!(ControlRequest::from_bytes(&request.to_bytes()), Ok(request));
    }
}

#[test]
fn the_words_of_a_batch_keep_their_places() {
    let (served, memory) = ServedBatch::create().unwrap();
    let claimed = ClaimedBatch::open(&memory).unwrap();
    let shape = BatchShape::new(2, 2, 1).unwrap();
    let head = BatchHead { version: 7, plan: 9, fingerprint: 42, sequence: 3, rows: 2 };
    claimed.send(&head, &shape, &[1.0, 2.0, 3.0, 4.0]);
    let warned = Answer { status: Status::Ok, warnings: Warnings(5) };
    let failed = Answer { status: Status::Unreachable, warnings: Warnings::NONE };
    served.write(&shape, 0, &[warned, failed], &[5.0, 6.0]);
    served.publish(3, Status::Ok);

    let memory = File::from(memory);
    assert_eq!((memory.metadata().unwrap().len(), BATCH_WORDS), (1 << 20, 1 << 17));
    let mut bytes = [0; 24 * 8];
    memory.read_exact_at(&mut bytes, 0).unwrap();
    let words: Vec<u64> =
        bytes.as_chunks().0.iter().map(|word| u64::from_ne_bytes(*word)).collect();
    let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(f64::to_bits);
    let unreachable = Status::Unreachable as u64;
    assert_eq!(words[..4], [3, 7 | 9 << 32, 42, 2]);
    assert_eq!(words[8..11], [3, 0, 2]);
    assert_eq!(words[16..18], [5 << 32, unreachable]);
    assert_eq!(words[18..], numbers);
}

#[test]
fn what_a_bridge_says_keeps_its_numbers_and_names() {
    let states = MechanismState::ALL.iter().map(|state| (*state as u32, state.name()));
    assert!(states.eq((0..).zip(["disabled", "arming", "enabled", "fault", "stopping"])));
    let operations = Operation::ALL.iter().map(|operation| (*operation as u32, operation.name()));
    assert!(operations.eq((1..).zip(["arm", "disarm", "reset", "return", "confirm"])));
    const REASONS: [&str; 37] = [
        "none",
        "disarmed",
        "command_lost",
        "stalled",
        "no_command",
        "not_calibrated",
        "watchdog_off",
        "watchdog_unknown",
        "feedback_stale",
        "motor_fault",
        "power_lost",
        "arming_timeout",
        "bus_passive",
        "bus_off",
        "backlog",
        "other_mechanism",
        "watchdog_long",
        "position_limit",
        "velocity_limit",
        "following_error",
        "effort_mismatch",
        "feedback_frozen",
        "feedback_jump",
        "feedback_late",
        "second_answer",
        "second_master",
        "over_temperature",
        "outside_limits",
        "mechanism_limit",
        "unreachable",
        "near_singular",
        "loop_residual",
        "model_effort",
        "moving",
        "not_commissioned",
        "position_changed",
        "external_force",
    ];
    for (code, name) in (0..).zip(REASONS) {
        assert_eq!(Reason::from_code(code).map(Reason::name), Some(name));
    }
}

#[test]
fn a_number_that_this_version_does_not_know_has_no_meaning() {
    for code in [21, 22, 1 << 16, u32::MAX] {
        assert_eq!((Status::from_code(code), Status::name_of(code)), (None, "unknown"));
        assert_eq!(Status::of_answer(code), Status::UnknownStatus);
    }
    for code in [99, u32::MAX] {
        assert_eq!((Request::name_of(code), Operation::name_of(code)), ("unknown", "unknown"));
        assert_eq!((Reason::name_of(code), MechanismState::name_of(code)), ("unknown", "unknown"));
    }
}

#[test]
fn fields_are_packed_in_the_order_of_their_numbers() {
    let sizes = Sizes {
        n_q: 10,
        n_v: 9,
        n_qy: 8,
        n_vy: 7,
        n_u: 3,
        n_c: 2,
        n_branches: 4,
        n_bodies: 9,
        n_cuts: 2,
    };
    let given = FieldSet::of(&[Field::TauU, Field::Yd, Field::Y]);
    let query = Query::new(Request::ForwardDynamics, given, FieldSet::of(&Field::ALL[..42]))
        .with_frames(&[1, 0])
        .with_wrenches(&[1]);
    let info = ModelInfo { sizes, ..ModelInfo::default() };
    let slots = |layout: Layout| {
        layout.slots().iter().map(|slot| (slot.offset, slot.rows, slot.columns)).collect::<Vec<_>>()
    };
    assert_eq!(
        slots(Layout::of_given(&query, &sizes)),
        [(0, 8, 1), (8, 7, 1), (15, 3, 1), (18, 1, 6)]
    );
    let shapes = [
        (8, 1),
        (7, 1),
        (7, 1),
        (10, 1),
        (9, 1),
        (9, 1),
        (3, 1),
        (3, 1),
        (3, 1),
        (10, 1),
        (9, 1),
        (9, 1),
        (7, 1),
        (3, 1),
        (1, 6),
        (7, 1),
        (9, 7),
        (9, 1),
        (3, 7),
        (3, 1),
        (2, 9),
        (2, 1),
        (2, 1),
        (7, 7),
        (7, 1),
        (1, 1),
        (1, 1),
        (1, 1),
        (1, 1),
        (1, 1),
        (8, 1),
        (2, 7),
        (2, 6),
        (2, 6),
        (12, 9),
        (12, 7),
        (12, 3),
        (1, 1),
        (4, 1),
        (2, 1),
        (9, 1),
        (7, 1),
    ];
    let mut offset = 0;
    for (slot, (rows, columns)) in slots(Layout::of_want(&query, &info)).into_iter().zip(shapes) {
        assert_eq!(slot, (offset, rows, columns));
        offset += rows * columns;
    }
    assert_eq!(Layout::of_want(&query, &info).len(), offset);
}

//! The controller in C++ against the bridge's side of its services.

use std::time::{Duration, Instant};

use sarrus_models::{Options, Source, load};
use sarrus_proto::actuators::{ActuatorState, MechanismState};
use sarrus_proto::bridge::BridgeEnd;
use sarrus_proto::heartbeat::monotonic_ns;
use sarrus_proto::{Domain, ServerName};

use super::{CPP, Program, folder, with_sanitizers};
use crate::examples::root;

#[test]
fn the_controller_in_cpp_commands_1000_times_a_second_what_carries_the_robot() {
    let path = folder().join("examples/controller_1khz.cpp");
    let loaded = load(&Source::Bundled("rh5v2_upper_body".into()), &Options::default()).unwrap();
    let info = loaded.compiled.model.info().clone();
    for compiler in with_sanitizers(&CPP) {
        let program = Program::compile(compiler, &path, super::SANITIZERS);
        let domain = Domain::at(&root()).unwrap();
        let node = domain.node().unwrap();
        let name = format!("bridge-{compiler}").replace('+', "p");
        let bridge = BridgeEnd::create(&node, &ServerName::new(&name).unwrap()).unwrap();

        let mut talk = program.talk(&[&name, "rh5v2_upper_body", "0.5"]);
        let n_u = info.active.len();
        let mut state = ActuatorState {
            n_u: n_u as u64,
            fingerprint: info.fingerprint,
            state: MechanismState::Enabled as u32,
            ..ActuatorState::default()
        };
        state.position[..n_u].fill(0.0);
        let mut last = None;
        let mut taken = 0;
        let start = Instant::now();
        let ended = loop {
            state.sequence += 1;
            state.stamp_ns = monotonic_ns();
            assert!(bridge.publish(&state));
            std::thread::sleep(Duration::from_millis(1));
            if let Some(command) = bridge.command() {
                let before = last
                    .as_ref()
                    .map_or(0, |last: &sarrus_proto::actuators::ActuatorCommand| last.sequence);
                assert!(command.sequence > before && command.stamp_ns <= monotonic_ns());
                assert_eq!((command.fingerprint, command.n_u), (info.fingerprint, n_u as u64));
                (last, taken) = (Some(command), taken + 1);
            }
            if let Some(status) = talk.child.try_wait().unwrap() {
                break status;
            }
            assert!(start.elapsed() < Duration::from_secs(120), "the controller does not end");
        };
        assert!(ended.success());
        let line = talk.line();
        println!("{taken} commands taken; {line}");
        assert!(line.starts_with("500 cycles, ") && line.contains(", 0 poses without"), "{line}");
        let (_, effort) = line.split_once("effort ").unwrap();
        let effort: Vec<f64> = effort.split(' ').map(|number| number.parse().unwrap()).collect();
        let last = last.expect("no command came");
        assert_eq!(last.effort[..n_u], effort);
        assert!(effort.iter().any(|effort| effort.abs() > 1.0) && last.damping[0] == 1.0);
        drop(bridge);
        drop(node);
        domain.tidy();
    }
}

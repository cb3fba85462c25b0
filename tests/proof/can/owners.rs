//! Names and controllers are exclusive: the error for the second one names the owner.

use std::process::Command;

use sarrus_tests::python::environment;

use super::harness::{BUSES, FRONTENDS, Process, Stage, sarrus_can};

#[test]
fn a_name_has_one_bridge_and_a_bridge_one_controller_and_a_second_one_reads_whose_it_is() {
    for frontend in FRONTENDS {
        let stage = Stage::new();
        let _motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
        let bridge = stage.bridge(frontend);
        let mut controller = stage.controller();
        controller.state();
        let refused = |mut command: Command, words: [String; 2]| {
            let output = command.output().unwrap();
            let text = String::from_utf8(output.stderr).unwrap();
            assert!(!output.status.success(), "{frontend:?}: {text}");
            for word in words {
                assert!(text.contains(&word), "{frontend:?} {word}: {text}");
            }
        };
        let owner = |process: &Process| format!("process {} (", process.id());
        for other in FRONTENDS {
            let what = "a bridge named `end_to_end` runs already".to_owned();
            refused(stage.bridge_command(other), [what, owner(&bridge)]);
        }
        let what = || "the bridge `end_to_end` has a controller already".to_owned();
        let mut hold = Command::new(sarrus_can().with_file_name("examples").join("hold"));
        hold.arg("end_to_end");
        refused(stage.at_home(hold), [what(), owner(&controller)]);
        let script = "from sarrus.can import Controller; Controller('end_to_end')";
        let python = environment().command(&["-c", script]);
        refused(stage.at_home(python), [what(), owner(&controller)]);
    }
}

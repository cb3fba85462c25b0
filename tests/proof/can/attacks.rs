//! Every attack on every protocol with a drive in the attack table, in all frontends: in the core
//! here, in the program's replay, and in a bridge of the Python package with the same input as
//! objects. All have the same bytes, the same reason, and the same time until the torque is gone.
//! The table is printed.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::config::Configuration;
use sarrus_can_core::fault_files::FaultFiles;
use sarrus_can_core::fault_log::FaultLog;
use sarrus_can_core::log::Line;
use sarrus_tests::python::environment;
use serde_json::Value;

use super::attack_table::recorded;
use super::attack_table::{ATTACKS, Outcome, bound, drives, is_possible};
use super::harness::sarrus_can;
use super::world::{World, keep};

/// Output of a frontend for a record.
#[derive(Debug, Default, PartialEq)]
struct Result {
    frames: String,
    /// Time and actuator of each fault, and its reason in the frontend's words.
    faults: Vec<String>,
}

/// An attack on a drive, with its outcome in the core.
struct Case {
    attack: &'static str,
    drive: &'static str,
    protocol: String,
    files: [PathBuf; 2],
    outcome: Outcome,
    core: Result,
}

/// Runs an attack in the core, and writes its configuration and its input.
fn case(folder: &Path, place: usize, attack: usize, drive: &(&'static str, String)) -> Case {
    let (attack, run) = ATTACKS[attack];
    let mut world = recorded(&drive.1);
    let outcome = run(&mut world);
    let record = world.record.take().unwrap_or_default();
    let configuration = world.bridge.configuration();
    let files = [folder.join(format!("{place}.yml")), folder.join(format!("{place}.jsonl"))];
    std::fs::write(&files[0], World::text(&drive.1, "")).unwrap();
    let mut log = String::new();
    for line in &record.lines {
        writeln!(log, "{}", line.text(configuration)).unwrap();
    }
    std::fs::write(&files[1], log).unwrap();
    let frames = record.frames.iter().map(|frame| format!("{frame}\n")).collect();
    let faults = record.faults.clone();
    let protocol =
        drive.1.split("protocol: ").nth(1).and_then(|rest| rest.split([',', '}']).next());
    Case {
        attack,
        drive: drive.0,
        protocol: protocol.unwrap_or_default().to_owned(),
        files,
        outcome,
        core: Result { frames, faults },
    }
}

/// The replay of the program.
fn program(files: &[PathBuf; 2]) -> Result {
    let output = Command::new(sarrus_can()).arg("replay").args(files).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    let faults = stderr.lines().filter_map(|line| line.strip_prefix("sarrus-can replay: at "));
    Result {
        frames: String::from_utf8(output.stdout).unwrap(),
        faults: faults.map(str::to_owned).collect(),
    }
}

/// The file of the last fault of a case, as the loop of a bridge writes it.
fn fault_file(
    folder: &Path,
    place: usize,
    [configuration, input]: &[PathBuf; 2],
) -> Option<PathBuf> {
    let mut bridge = Bridge::new(Configuration::load(configuration).unwrap());
    let configuration = bridge.configuration().without_motors();
    let files = FaultFiles::new(folder.join("faults"), &format!("case{place}"));
    let mut log = FaultLog::default();
    let mut newest = None;
    let mut since_ns = None;
    for text in std::fs::read_to_string(input).unwrap().lines() {
        let line = Line::read(text, &configuration).unwrap();
        let (before, _) = bridge.faults();
        keep(&mut bridge, &mut log, since_ns.get_or_insert(line.t), line);
        if let (now, Some((_, reason))) = bridge.faults()
            && now != before
        {
            newest = Some(files.write(u128::from(now), reason, &log, &configuration).unwrap());
        }
    }
    newest
}

/// All cases through bridges of the Python package, in one process.
fn python(folder: &Path, n: usize) -> Vec<Result> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/can/attacks.py");
    let output = environment()
        .command(&[script.to_str().unwrap(), folder.to_str().unwrap(), &n.to_string()])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let results = (0..n).map(|place| {
        let read = |ending: &str| {
            std::fs::read_to_string(folder.join(format!("{place}.{ending}"))).unwrap()
        };
        let faults: Value = serde_json::from_str(&read("faults.json")).unwrap();
        let faults = faults.as_array().unwrap().iter();
        Result {
            frames: read("frames"),
            faults: faults.map(|fault| fault.as_str().unwrap().to_owned()).collect(),
        }
    });
    results.collect()
}

#[test]
fn every_attack_ends_alike_in_the_core_the_program_and_the_python_package() {
    let folder = std::env::temp_dir().join(format!("sarrus-attacks-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut cases = Vec::new();
    for attack in 0..ATTACKS.len() {
        for drive in &drives() {
            if is_possible(ATTACKS[attack].0, drive.0) {
                cases.push(case(&folder, cases.len(), attack, drive));
            }
        }
    }
    let by_python = python(&folder, cases.len());
    // longest times by attack and protocol
    let mut short: BTreeMap<(&str, &str), (f64, Vec<&str>)> = BTreeMap::new();
    println!("attack | drive | frontend | reason | rad, rad/s, N m | ms to found, to no torque");
    for (place, (case, in_python)) in cases.iter().zip(&by_python).enumerate() {
        let name = format!("{}: {}", case.attack, case.drive);
        let in_program = program(&case.files);
        let Outcome { ms, safe_ms, reason, position, velocity, torque } = case.outcome;
        let (Some(ms), Some(safe_ms)) = (ms, safe_ms) else { panic!("{name}: never") };
        assert!(ms <= bound(case.attack), "{name}: {ms} ms");
        assert!(case.core.faults.iter().any(|fault| fault.ends_with(reason.name())), "{name}");
        for (frontend, result) in
            [("core", &case.core), ("sarrus-can", &in_program), ("sarrus.can", in_python)]
        {
            assert!(result.frames == case.core.frames, "{name}: the frames of {frontend} differ");
            assert_eq!(result.faults, case.core.faults, "{name}: {frontend}");
            println!(
                "{} | {} | {frontend} | {} | {position:.2}, {velocity:.2}, {torque:.2} | {ms:.0}, \
                    {safe_ms:.0}",
                case.attack,
                case.drive,
                reason.name(),
            );
        }
        // the program replays the file of the last fault to the same fault
        let newest = fault_file(&folder, place, &case.files);
        let newest = newest.unwrap_or_else(|| panic!("{name}: no file"));
        let again = program(&[case.files[0].clone(), newest]);
        assert_eq!(again.faults.last(), case.core.faults.last(), "{name}");
        let of = short.entry((case.attack, case.protocol.as_str())).or_default();
        of.0 = of.0.max(ms);
        of.1.push(reason.name());
    }
    println!();
    for ((attack, protocol), (ms, mut reasons)) in short {
        reasons.sort_unstable();
        reasons.dedup();
        println!("{attack} | {protocol} | {} | {ms:.0} ms", reasons.join(", "));
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

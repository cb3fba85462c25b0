//! SocketCAN of a real kernel: Linux in a process of its own (user-mode Linux), which sees this computer's files and has the modules of CAN.
//!
//! Not run, and told so, where `linux.uml`, `busybox`, `cansend`, `candump`, `cangen`, `slcand`, `ip` or `cc` are missing: on Debian
//! `apt-get install user-mode-linux busybox-static can-utils iproute2 gcc`. Its clock counts hundredths of seconds: this test is about what is
//! right and never about time.

use std::process::{Command, Stdio};
use std::time::Duration;

use super::Folder;

/// Completes the state of a processor for a kernel that is older than it.
const WHOLE_STATE: &str = include_str!("whole_state.c");

const TOOLS: [&str; 8] = ["linux.uml", "busybox", "cansend", "candump", "cangen", "slcand", "ip", "cc"];

const MIT: &str = "watchdog_ms: 10000, watchdog: believed, offset: 0, limits: {effort: 10}, drive: {protocol: mit, variant: mini_cheetah, \
    id: 3, reply_id: 19, position_range: 12.5, velocity_range: 30, torque_range: 10, stiffness_range: 500, damping_range: 5}}";

/// The first process of the virtual machine: it prints `step NAME` and what each step gave.
const INIT: &str = include_str!("init.sh");

#[test]
fn frames_states_and_full_queues_of_a_real_kernel() {
    let missing: Vec<&str> = TOOLS.into_iter().filter(|tool| find(tool).is_none()).collect();
    if !missing.is_empty() {
        eprintln!("NOT RUN: the test of SocketCAN in a real kernel, for want of {}", missing.join(", "));
        return;
    }
    let said = boot();
    let step = |name: &str| {
        let from = said.split(&format!("step {name}\n")).nth(1).unwrap_or_else(|| panic!("no step {name}:\n{said}"));
        from.split("step ").next().unwrap_or_default()
    };

    // classic and FD frames pass, in both directions
    assert!(step("enable").contains("vcan0 003#FFFFFFFFFFFFFFFC"), "{said}");
    assert!(step("enable").contains("vcan0 013#037FFF"), "{said}");
    for expected in ["vcan0 003#FFFFFFFFFFFFFFFC", "vcan0 013#037FFF", "vcan0 1ABCDEF0##10011223344556677", "\"event\":\"power\""] {
        assert!(step("heard").contains(expected), "{expected}:\n{said}");
    }
    // what cannot be is said
    assert!(step("classic").contains("carries no CAN FD") && step("classic").contains("none cannot be opened"), "{said}");
    assert_eq!(step("classic").matches("code 2").count(), 2, "{said}");
    // the kernel's error frames
    for state in ["ErrorWarning", "ErrorPassive", "ErrorActive", "BusOff"] {
        assert!(step("states").contains(state), "{state}:\n{said}");
    }
    // a queue that nobody empties drops frames and does not stop the sender
    let report: serde_json::Value =
        step("full").lines().find_map(|line| serde_json::from_str(line).ok()).unwrap_or_else(|| panic!("{said}"));
    let bus = &report["buses"][0];
    assert!(bus["sent"].as_u64().unwrap() > 0 && bus["lost"].as_u64().unwrap() > 4, "{said}");
    assert!(said.contains("ENOBUFS"), "{said}");
    assert!(said.contains("step end"), "{said}");
}

fn find(tool: &str) -> Option<std::path::PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders = std::env::split_paths(&path).chain(["/usr/sbin".into(), "/sbin".into()]);
    folders.map(|folder| folder.join(tool)).find(|path| path.exists())
}

/// Boots a kernel, which runs [`INIT`] and ends; all that it said.
fn boot() -> String {
    let folder = Folder::new();
    let write = |name: &str, text: &str| std::fs::write(folder.path(name), text).unwrap();
    let motors = |interface: &str, channel: &str, motor: &str| {
        let bus = format!("{{name: arm, interface: {interface}, channel: {channel}, bitrate: 1000000}}");
        format!("rate_hz: 100\nbuses: [{bus}]\nmotors:\n- {{actuator: elbow, bus: arm, {motor}\n")
    };
    write("vcan.yml", &motors("socketcan", "vcan0", MIT));
    write("slcan.yml", &motors("slcan", &folder.path("bus").display().to_string(), MIT));
    write("full.yml", &motors("socketcan", "slcan0", MIT));
    write("whole_state.c", WHOLE_STATE);
    let busybox = find("busybox").unwrap().display().to_string();
    let init = INIT.replace("BUSYBOX", &busybox).replace("PROGRAM", env!("CARGO_BIN_EXE_sarrus-can"));
    write("init", &init.replace("FOLDER", folder.0.to_str().unwrap()));
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(folder.path("init"), executable).unwrap();
    let library = folder.path("whole_state.so");
    let built = Command::new("cc").args(["-O2", "-shared", "-fPIC", "-o"]).arg(&library).arg(folder.path("whole_state.c")).status();
    assert!(built.unwrap().success());

    let mut kernel = Command::new(find("linux.uml").unwrap());
    kernel.args(["mem=256M", "rootfstype=hostfs", "rootflags=/", "rw", "con=null", "con0=fd:0,fd:1", "ssl=null", "quiet"]);
    kernel.arg(format!("init={}", folder.path("init").display())).env("LD_PRELOAD", &library);
    if std::path::Path::new("/dev/shm").is_dir() {
        kernel.env("TMPDIR", "/dev/shm");
    }
    let mut child = kernel.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut stdout = child.stdout.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut said = Vec::new();
        let _ = std::io::Read::read_to_end(&mut stdout, &mut said);
        String::from_utf8_lossy(&said).replace('\r', "")
    });
    // a kernel that hangs is ended, and what it said tells where
    let end = std::time::Instant::now() + Duration::from_secs(180);
    while child.try_wait().unwrap().is_none() && std::time::Instant::now() < end {
        std::thread::sleep(Duration::from_millis(50));
    }
    let _ = child.kill();
    let _ = child.wait();
    reader.join().unwrap()
}

//! Recordings of killed servers, and their replay.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use sarrus_client::{Field, FieldSet, Query, QueryOptions, Request, Robot, Status, Transport};

use sarrus_serve::record::{Client, Gaps, Recording};

use crate::batches::Rows;
use crate::supervise::{kill, serving};
use crate::support::{Asker, ROBOT, Sandbox, wait_until};

/// A folder of its own for each test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("sarrus-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Exit code and results of `sarrus replay`.
fn replay(file: &str, flags: &[&str]) -> (Option<i32>, serde_json::Value, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus"));
    let output = command.args(["replay", file, "--format", "json"]).args(flags).output().unwrap();
    let results = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (output.status.code(), results, String::from_utf8(output.stderr).unwrap())
}

/// Three kinds of questions, among them one with frames and wrenches.
fn queries() -> [Query; 3] {
    let motion = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let forces = FieldSet::of(&[Field::TauY, Field::TauU]);
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::TauY]);
    let pushed = FieldSet::of(&[Field::Ydd, Field::FramePose, Field::Residual]);
    [
        Query::new(Request::InverseDynamics, motion, forces),
        Query::new(Request::ForwardDynamics, given, pushed)
            .with_frames(&[1, 2, 3, 4, 5])
            .with_wrenches(&[4, 2]),
        Query::new(Request::Kinematics, Field::U.into(), FieldSet::of(&[Field::Q, Field::G])),
    ]
}

/// Asks `n` random questions, some of them beyond any pose and some not numbers; statuses counted.
fn ask(robot: &mut Robot, n: usize, seed: u64) -> [usize; 2] {
    let plans = queries().map(|query| {
        let plan = robot.prepare(&query).unwrap();
        let prepared = robot.plan(plan).unwrap();
        (plan, prepared.given().len(), prepared.want().len())
    });
    let mut state = seed;
    let mut counts = [0; 2];
    let mut random = || {
        // Knuth's MMIX
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for k in 0..n {
        let (plan, n_in, n_out) = plans[k % plans.len()];
        let scale = if k % 7 == 0 { 20.0 } else { 0.4 };
        let mut input: Vec<f64> = (0..n_in).map(|_| scale * random()).collect();
        if k % 50 == 0 {
            input[k % n_in] = [f64::NAN, f64::INFINITY][k / 50 % 2];
        }
        let answer = robot.ask(plan, &input, &mut vec![0.0; n_out]).unwrap();
        counts[usize::from(answer.status != Status::Ok)] += 1;
    }
    counts
}

/// Waits until the recorder has written the answered requests and statistics count them.
fn settle() {
    std::thread::sleep(Duration::from_millis(300));
}

#[test]
fn what_was_answered_before_a_kill_is_on_record_and_comes_out_the_same() {
    const N: usize = 4000;
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-kill");
    let file = folder.file("box");
    let flags = ["--record", &file, "--record-seconds", "20", "--lanes", "2"];
    let server = sandbox.serve("box", &flags);
    let counts = std::thread::scope(|scope| {
        let clients = [Transport::Lane, Transport::Lane, Transport::Service].map(|transport| {
            let mut robot = sandbox.connect("box", transport).unwrap();
            scope.spawn(move || ask(&mut robot, N, transport as u64 + 1))
        });
        clients.map(|client| client.join().unwrap())
    });
    let [ok, failed] = [0, 1].map(|k| counts.iter().map(|count| count[k] as u64).sum::<u64>());
    assert!(ok > 3 * N as u64 / 2 && failed > 3 * N as u64 / 10, "{counts:?}");
    settle();
    let statistics = sandbox.connect("box", Transport::Service).unwrap().statistics().unwrap();
    let served = statistics.counts.lane_requests + statistics.counts.service_requests;
    assert_eq!((served, statistics.system_allocations), (3 * N as u64, 0));
    server.kill();

    let (code, replayed, words) = replay(&file, &[]);
    assert_eq!((code, words.as_str()), (Some(0), ""), "{replayed}");
    assert_eq!(replayed["requests"], 3 * N as u64);
    assert_eq!(replayed["statuses"]["ok"], ok);
    // a lane that grows or is given back changes its slot
    assert!((2..=3).contains(&replayed["clients"].as_u64().unwrap()), "{replayed}");
    for key in ["differing_bits", "differing_answers", "lost", "damaged", "refused", "unplanned"] {
        assert_eq!(replayed[key], 0, "{key}: {replayed}");
    }
    let seconds = replayed["seconds"].as_f64().unwrap();
    assert!(seconds > 0.0 && seconds < 60.0, "{replayed}");
}

#[test]
fn every_answer_is_on_record_however_soon_the_kill_comes() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-soon");
    let [file, earlier] = ["box", "box.1"].map(|name| folder.file(name));
    let flags = ["--record", &file, "--record-seconds", "60", "--lanes", "2"];
    // each answer that a client had, once, and the same bits
    let has = |file: &str, answered: [u64; 2]| {
        let (code, replayed, words) = replay(file, &[]);
        assert_eq!((code, words.as_str()), (Some(0), ""), "{replayed}");
        let mut last = BTreeMap::from([(Client::Lane(0), 0), (Client::Service, 0)]);
        let mut recording = Recording::open(File::open(file).unwrap()).unwrap();
        let read = recording.read(|entry, _| {
            let before = last.insert(entry.client, entry.sequence).unwrap();
            assert_eq!(entry.sequence, before + 1, "{last:?}");
        });
        assert_eq!(read.unwrap(), Gaps::default());
        assert!(last.values().zip(&answered).all(|(on, had)| on >= had), "{answered:?}: {last:?}");
    };
    let mut answered = [0; 2];
    for round in 0..6_u64 {
        let server = sandbox.serve_robot("lambda", "box", &flags);
        if round % 2 == 1 {
            // the server that follows a killed one completes its recording
            has(&earlier, answered);
        }
        answered = std::thread::scope(|scope| {
            let clients = [Transport::Lane, Transport::Service].map(|transport| {
                let mut asker = sandbox.attach_briefly("box", transport);
                scope.spawn(move || (0..20_000).take_while(|_| asker.ask().is_ok()).count() as u64)
            });
            std::thread::sleep(Duration::from_micros(1800 * round));
            server.kill();
            clients.map(|client| client.join().unwrap())
        });
        if round % 2 == 1 {
            has(&file, answered);
            let complete = fs::read(&file).unwrap();
            has(&file, answered);
            assert_eq!(fs::read(&file).unwrap(), complete);
        }
    }
}

#[test]
fn replays_at_once_and_of_a_copy_lose_nothing() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-copy");
    let [file, copy] = ["box", "copy"].map(|name| folder.file(name));
    let flags = ["--record", &file, "--record-seconds", "20", "--lanes", "1"];
    for _ in 0..3 {
        let server = sandbox.serve_robot("lambda", "box", &flags);
        let mut asker = sandbox.attach_briefly("box", Transport::Lane);
        // it asked once when it came
        (0..99).for_each(|_| assert!(asker.ask().is_ok()));
        settle();
        fs::copy(&file, &copy).unwrap();
        let (code, replayed, words) = replay(&copy, &[]);
        assert_eq!((code, &replayed["requests"], words.as_str()), (Some(0), &100.into(), ""));
        (0..1000).for_each(|_| assert!(asker.ask().is_ok()));
        server.kill();
        let all = std::thread::scope(|scope| {
            [(); 3].map(|()| scope.spawn(|| replay(&file, &[]))).map(|one| one.join().unwrap())
        });
        for (code, replayed, words) in all {
            assert_eq!((code, &replayed["requests"], words.as_str()), (Some(0), &1100.into(), ""));
        }
    }
}

#[test]
fn a_search_and_a_late_answer_are_on_record_as_they_were() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-search");
    let file = folder.file("box");
    let flags = ["--record", &file, "--record-seconds", "20", "--lanes", "1"];
    let server = sandbox.serve_robot("wrist", "box", &flags);
    let mut robot = sandbox.connect("box", Transport::Lane).unwrap();
    let query = Query::new(Request::Kinematics, Field::Y.into(), Field::NearestY.into())
        .with_options(QueryOptions::SEARCH);
    let plan = robot.prepare(&query).unwrap();
    let mut statuses = BTreeMap::new();
    for k in 0..100_u64 {
        robot.set_deadline((k > 9).then(|| Duration::from_micros(100 * k)));
        let y = [2.0 + 0.01 * k as f64, 2.0];
        let mut nearest = [f64::NAN; 2];
        let answer = robot.ask(plan, &y, &mut nearest).unwrap();
        assert!(k > 9 || nearest[0].is_finite(), "{answer:?}");
        *statuses.entry(answer.status.name()).or_insert(0) += 1;
    }
    drop(robot);
    assert!(server.stop().success());
    let (code, replayed, words) = replay(&file, &[]);
    assert_eq!((code, words.as_str()), (Some(0), ""), "{replayed}");
    assert_eq!(replayed["statuses"], serde_json::to_value(&statuses).unwrap(), "{replayed}");
}

#[test]
fn rows_of_a_batch_are_on_record_like_single_requests() {
    const N: usize = 3000;
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-rows");
    let file = folder.file("box");
    let server = sandbox.serve("box", &["--record", &file, "--record-seconds", "20"]);
    let mut asker = Asker::new(sandbox.connect("box", Transport::Lane).unwrap());
    Rows::new(&asker, N).ask(&mut asker).unwrap();
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    settle();
    assert_eq!(asker.robot.statistics().unwrap().system_allocations, 0);
    server.kill();
    let (code, replayed, words) = replay(&file, &[]);
    assert_eq!((code, words.as_str()), (Some(0), ""), "{replayed}");
    assert_eq!((&replayed["requests"], &replayed["clients"]), (&(N + 1).into(), &1.into()));
    for key in ["differing_bits", "differing_answers", "lost", "damaged", "refused", "unplanned"] {
        assert_eq!(replayed[key], 0, "{key}: {replayed}");
    }
}

#[test]
fn a_clean_stop_leaves_everything_and_the_next_run_keeps_it() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-next");
    let file = folder.file("box");
    let flags = ["--record", &file, "--record-seconds", "1", "--lanes", "1"];
    for run in 1..=3 {
        let server = sandbox.serve("box", &flags);
        // other users cannot write there
        let second = sandbox.command(ROBOT, "other", &flags).output().unwrap();
        let words = String::from_utf8(second.stderr).unwrap();
        assert_eq!(second.status.code(), Some(2));
        assert!(words.contains("another server records to"), "{words}");
        let mut robot = sandbox.connect("box", Transport::Lane).unwrap();
        // the second run has no requests: the recording stays
        if run != 2 {
            let _ = ask(&mut robot, 100 * run, 7);
        }
        drop(robot);
        assert!(server.stop().success());
        assert_eq!(replay(&file, &[]).1["requests"], if run == 2 { 0 } else { 100 * run });
        let kept = Path::new(&format!("{file}.1")).exists();
        assert_eq!(kept, run > 1);
        if kept {
            assert_eq!(replay(&format!("{file}.1"), &[]).1["requests"], 100);
        }
    }
}

#[test]
fn the_last_runs_are_kept_in_their_order() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-runs");
    let file = folder.file("box");
    let flags = ["--record", &file, "--record-seconds", "1", "--lanes", "1"];
    for run in 1..=6 {
        let server = sandbox.serve("box", &flags);
        let mut robot = sandbox.connect("box", Transport::Lane).unwrap();
        let _ = ask(&mut robot, 10 * run, 7);
        drop(robot);
        assert!(server.stop().success());
    }
    let requests = |name: &str| replay(&format!("{file}{name}"), &[]).1["requests"].as_u64();
    let kept = ["", ".1", ".2", ".3", ".4"].map(requests);
    assert_eq!(kept, [60, 50, 40, 30, 20].map(Some));
    assert!(!Path::new(&format!("{file}.5")).exists());
}

#[test]
fn a_supervised_server_without_room_for_its_recording_answers() {
    let probe = Command::new("unshare").args(["--mount", "true"]).output();
    if !probe.is_ok_and(|output| output.status.success()) {
        println!("not run: this user has no mounts of its own");
        return;
    }
    // a disk with room for one recording and a sixth, or for one, seen by these processes only
    for (size, warning) in [
        ("52m", "the disk has room to record 7 s only"),
        ("45m", "nothing is recorded: no room for "),
    ] {
        let sandbox = Sandbox::new();
        let folder = Folder::new("record-room");
        let file = folder.file("box");
        let flags = ["--supervise", "--short-life", "0", "--record", &file, "--lanes", "1"];
        let flags = [&flags[..], &["--record-seconds", "60"]].concat();
        let inner = sandbox.command(ROBOT, "box", &flags);
        let script = format!("mount -t tmpfs -o size={size} sarrus \"$0\" && exec \"$@\"");
        let mut outer = Command::new("unshare");
        outer.args(["--mount", "sh", "-c", &script]).arg(&folder.0);
        outer.arg(inner.get_program()).args(inner.get_args());
        outer.envs(inner.get_envs().filter_map(|(name, value)| Some((name, value?))));
        let server = sandbox.start(&mut outer);

        let mut robot = sandbox.attach_briefly("box", Transport::Lane).robot;
        let _ = ask(&mut robot, 10, 7);
        let process = serving(server.id());
        let seen = format!("/proc/{process}/root{file}");
        wait_until("the requests are on record", || {
            replay(&seen, &[]).1["requests"].as_u64() >= Some(10)
        });
        kill(process);
        server.wait_for_line(warning);
        let mut robot = sandbox.attach_briefly("box", Transport::Lane).robot;
        let _ = ask(&mut robot, 10, 7);
        drop(robot);
        assert!(server.stop().success());
    }
}

#[test]
fn a_limit_of_the_sizes_of_files_is_a_reason_and_no_signal() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-limit");
    let flags = ["--record", &folder.file("box"), "--record-seconds", "1", "--lanes", "1"];
    let inner = sandbox.command("lambda", "box", &flags);
    let mut outer = Command::new("sh");
    outer.args(["-c", "ulimit -f 64 && exec \"$@\"", "sh"]);
    outer.arg(inner.get_program()).args(inner.get_args());
    outer.envs(inner.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let output = outer.output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{:?}: {words}", output.status);
    assert!(words.contains("cannot record to") && words.contains("File too large"), "{words}");
}

#[test]
fn a_changed_bit_is_found() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-bit");
    let file = folder.file("box");
    let flags = ["--record", &file, "--record-seconds", "1", "--lanes", "1"];
    let server = sandbox.serve_robot("lambda", "box", &flags);
    let mut robot = sandbox.connect("box", Transport::Lane).unwrap();
    let query = Query::new(Request::Kinematics, Field::Y.into(), Field::U.into());
    let plan = robot.prepare(&query).unwrap();
    let mut bits = 0;
    for k in 0..100 {
        let mut u = [0.0];
        let _ = robot.ask(plan, &[0.01 * f64::from(k)], &mut u).unwrap();
        if k == 50 {
            bits = u[0].to_bits();
        }
    }
    settle();
    server.kill();
    assert_eq!(replay(&file, &[]).1["requests"], 100);

    let mut bytes = fs::read(&file).unwrap();
    let at = bytes.windows(8).position(|window| window == bits.to_le_bytes()).unwrap();
    bytes[at] ^= 1;
    fs::write(&file, bytes).unwrap();
    let (code, replayed, _) = replay(&file, &[]);
    assert_eq!((code, &replayed["damaged"]), (Some(1), &1.into()), "{replayed}");
    assert_eq!(replayed["requests"], 99);
}

#[test]
fn what_is_no_recording_is_refused_with_the_reason() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-refused");
    let file = folder.file("box");
    let text = folder.file("text");
    let flags = ["--record", &file, "--record-seconds", "1", "--lanes", "1"];
    assert!(sandbox.serve_robot("lambda", "box", &flags).stop().success());
    fs::write(&text, "a text that somebody needs").unwrap();
    let cut = folder.file("cut");
    fs::write(&cut, &fs::read(&file).unwrap()[..100_000]).unwrap();
    for (file, flags, reason) in [
        (&file, &["--robot", "torso"][..], "the robot has the fingerprint"),
        (&cut, &[], "it has 100000 bytes, expected"),
        (&text, &[], "it is no recording"),
        (&folder.file("nobody"), &[], "it cannot be read"),
    ] {
        let (code, _, words) = replay(file, flags);
        assert_eq!(code, Some(2), "{words}");
        assert!(words.starts_with("sarrus replay: ") && words.contains(reason), "{words}");
    }

    // and never overwritten
    let server = sandbox.command("lambda", "box", &["--record", &text]).output().unwrap();
    let words = String::from_utf8(server.stderr).unwrap();
    assert_eq!(server.status.code(), Some(2));
    assert!(words.contains("is no recording and is left as it is"), "{words}");
    assert_eq!(fs::read_to_string(&text).unwrap(), "a text that somebody needs");
    let text = format!("{file}.1");
    fs::write(&text, "another text").unwrap();
    let flags = ["--record", &file, "--record-seconds", "1", "--lanes", "1"];
    let server = sandbox.serve_robot("lambda", "box", &flags);
    let mut robot = sandbox.connect("box", Transport::Lane).unwrap();
    robot.prepare(&queries()[2]).unwrap();
    let mut asker = Asker::new(robot);
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    assert!(server.stop().success());
    let server = sandbox.command("lambda", "box", &flags).output().unwrap();
    let words = String::from_utf8(server.stderr).unwrap();
    assert_eq!(server.status.code(), Some(2));
    assert!(words.contains("box.1 is no recording and is left as it is"), "{words}");
    assert_eq!(fs::read_to_string(&text).unwrap(), "another text");

    // a disk without the room
    let full = folder.file("full");
    let flags = ["--record", &full, "--record-seconds", "86400", "--lanes", "256"];
    let server = sandbox.command(ROBOT, "box", &flags).output().unwrap();
    let words = String::from_utf8(server.stderr).unwrap();
    assert_eq!((server.status.code(), Path::new(&full).exists()), (Some(2), false));
    assert!(words.contains("no room for") || words.contains("cannot record to"), "{words}");
    assert_eq!(sandbox.leftovers(), Vec::<PathBuf>::new());
}

#[test]
fn a_robot_from_files_is_in_its_recording_with_what_was_held_of_it() {
    let sandbox = Sandbox::new();
    let folder = Folder::new("record-files");
    let (urdf, yaml) = sarrus_models::bundled_text("torso").unwrap();
    let mut sizes = Vec::new();
    for (name, held) in [("whole", &[][..]), ("held", &["--lock", "BodyRoll=-0.1"])] {
        let files = [folder.file("torso.urdf"), folder.file("torso.yml")];
        fs::write(&files[0], urdf).unwrap();
        fs::write(&files[1], yaml).unwrap();
        let file = folder.file(name);
        let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus"));
        command.args(["serve", "--name", name, "--urdf", &files[0], "--submechanisms", &files[1]]);
        command.args(["--gravity", "0,0,-1.62", "--record", &file, "--record-seconds", "1"]);
        let server = sandbox.start(command.args(held));
        let mut robot = sandbox.connect(name, Transport::Lane).unwrap();
        let plan = robot.prepare(&queries()[0]).unwrap();
        let n = robot.plan(plan).map(|plan| (plan.given().len(), plan.want().len())).unwrap();
        let _ = robot.ask(plan, &vec![0.1; n.0], &mut vec![0.0; n.1]).unwrap();
        sizes.push(robot.model().independent.clone());
        settle();
        server.kill();
        files.iter().for_each(|file| fs::remove_file(file).unwrap());
        let (code, replayed, words) = replay(&file, &[]);
        assert_eq!((code, &replayed["requests"]), (Some(0), &1.into()), "{replayed} {words}");
    }
    assert_eq!(sizes, [&["BodyPitch", "BodyRoll"][..], &["BodyPitch"]]);
}

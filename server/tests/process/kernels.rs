//! Generated kernels behind plans: the same bits, nothing more on the hot path, and reasons where
//! there is none.

use std::fs;
use std::num::NonZeroUsize;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use sarrus_client::{
    Answer, AnsweredBy, Kernels, Model, Options, QueryOptions, Robot, Source, Status, Transport,
    Warnings,
};
use sarrus_dynamics::Plan;
use sarrus_generate::{Cache, Cancel, Compiler, random_input};

use crate::load::system_calls_of_the_busy_loop;
use crate::supervise::{kill, serving, supervised, until};
use crate::support::{Asker, ROBOT, STATE, Sandbox, Server, published};

fn local(robot: &str) -> Robot {
    Robot::load(&Source::Bundled(robot.into()), &Options::default()).unwrap()
}

fn model(robot: &str) -> std::sync::Arc<Model<f64>> {
    local(robot).shared_model().unwrap()
}

/// The shared object of the state's query on a robot, made once for all tests; `None` without a
/// compiler.
fn object(robot: &'static str) -> Option<PathBuf> {
    static MADE: OnceLock<Cache> = OnceLock::new();
    let Some(compiler) = Compiler::found() else {
        println!("not run: no C compiler");
        return None;
    };
    let cache = MADE.get_or_init(|| {
        let name = format!("sarrus-kernels-{}", std::process::id());
        Cache::at(PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name))
    });
    let model = model(robot);
    let plan = Plan::new(&model, &STATE).unwrap();
    Some(cache.kernel(&model, &plan, &compiler, &Cancel::default()).unwrap().path)
}

/// Answers of both to many states, among them some that are out of range or have no answer.
fn compare(one: &mut Asker, other: &mut Asker) {
    let robot = one.robot.model().clone();
    let layout = one.robot.plan(one.plan).unwrap().given().clone();
    let mut answered = 0;
    for k in 0..2_000 {
        one.input = random_input(&robot, &layout, 55_000_000 + k);
        match k % 50 {
            0 => one.input.iter_mut().for_each(|x| *x *= 50.0),
            1 => one.input[0] = f64::NAN,
            2 => one.input.fill(0.0),
            _ => {}
        }
        other.input.clone_from(&one.input);
        let [a, b] = [one.ask().unwrap(), other.ask().unwrap()];
        assert_eq!((a, one.bits()), (b, other.bits()), "state {k}: {:?}", one.input);
        answered += usize::from(a.status == Status::Ok);
    }
    assert!((1_000..2_000).contains(&answered), "{answered}");
}

/// Answers of both to many states at once; how many there were.
fn compare_rows(one: &mut Asker, other: &mut Asker) -> u64 {
    const ROWS: usize = 3_000;
    let robot = one.robot.model().clone();
    let layout = one.robot.plan(one.plan).unwrap().given().clone();
    let mut input: Vec<f64> =
        (0..ROWS as u64).flat_map(|k| random_input(&robot, &layout, 77_000_000 + k)).collect();
    input[layout.len() * 7] = f64::NAN;
    let answers_of = |asker: &mut Asker| {
        let nothing = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut output = vec![0.0; ROWS * asker.output.len()];
        let mut answers = vec![nothing; ROWS];
        let threads = NonZeroUsize::new(2).unwrap();
        asker.robot.batch(asker.plan, threads, &input, &mut output, &mut answers).unwrap();
        (answers, output.iter().map(|x| x.to_bits()).collect::<Vec<u64>>())
    };
    let expected = answers_of(one);
    assert_eq!(expected.0[7].status, Status::NonFiniteInput);
    assert!(answers_of(other) == expected);
    ROWS as u64
}

#[test]
fn answers_by_a_kernel_have_the_same_bits_through_every_transport_and_in_process() {
    // without and with a closure by Newton's method
    for robot in ["lambda", "wrist"] {
        answered_by_kernel(robot);
    }
}

fn answered_by_kernel(name: &'static str) {
    let Some(path) = object(name) else { return };
    let sandbox = Sandbox::new();
    let flags = ["--wait", "busy", "--kernel", path.to_str().unwrap()];
    let server = sandbox.serve_robot(name, "quick", &flags);
    server.wait_for_line("kernel for kinematics of y, yd, ydd for q, qd, qdd, u: from the file");
    let mut generic = Asker::new(local(name));
    for transport in [Transport::Lane, Transport::Service] {
        let mut served = Asker::new(sandbox.connect("quick", transport).unwrap());
        let before = served.robot.statistics().unwrap().counts.by_kernel;
        compare(&mut generic, &mut served);
        let rows = compare_rows(&mut generic, &mut served);
        let statistics = published(&served.robot, |statistics| {
            statistics.counts.by_kernel > before + 1_000 + rows / 2
        });
        assert_eq!(statistics.system_allocations, 0, "{statistics:?}");
    }

    // in process, where nothing is allocated either
    let mut robot = local(name);
    robot.use_kernels(Kernels::File(path.clone())).unwrap();
    let mut quick = Asker::new(robot);
    let by = quick.robot.answered_by(quick.plan).unwrap();
    let AnsweredBy::Generated(manifest) = by else { panic!("{by:?}") };
    assert_eq!(manifest.query, STATE);
    compare(&mut generic, &mut quick);
    compare_rows(&mut generic, &mut quick);
    quick.input.fill(0.1);
    assert_eq!(quick.thousand(), (1000, 0, 0));

    // options make no other query, other fields do
    let checked = quick.robot.prepare(&STATE.with_options(QueryOptions::CHECKSUM)).unwrap();
    assert!(matches!(quick.robot.answered_by(checked), Ok(AnsweredBy::Generated(_))));
    let other = quick.robot.query(sarrus_client::Request::Kinematics).given(["y"]).want(["q"]);
    let other = other.prepare().unwrap();
    assert!(matches!(quick.robot.answered_by(other), Ok(AnsweredBy::Refused(_))));

    // a connected robot has its server's kernels
    let mut served = sandbox.connect("quick", Transport::Lane).unwrap();
    assert!(served.use_kernels(Kernels::File(path)).is_err());
}

#[test]
fn a_kernel_makes_no_system_call() {
    let Some(path) = object(ROBOT) else { return };
    system_calls_of_the_busy_loop(&["--kernel", path.to_str().unwrap()]);
}

/// The reason why a server does not start.
fn refused(sandbox: &Sandbox, robot: &str, path: &Path) -> String {
    let flags = ["--kernel", path.to_str().unwrap()];
    let output = sandbox.command(robot, "never", &flags).output().unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_file_that_is_no_kernel_of_the_robot_starts_no_server_and_the_reason_is_printed() {
    let Some(path) = object("lambda") else { return };
    let sandbox = Sandbox::new();
    let words = refused(&sandbox, "torso", &path);
    assert!(words.starts_with("sarrus serve: --kernel: "), "{words}");
    assert!(words.contains("made for the robot `lambda`"), "{words}");

    let copy = path.with_file_name(format!("damaged-{}", std::process::id()));
    let mut bytes = fs::read(&path).unwrap();
    bytes.truncate(bytes.len() / 2);
    fs::write(&copy, &bytes).unwrap();
    let words = refused(&sandbox, "lambda", &copy);
    assert!(words.contains("no kernel of this version") || words.contains("no whole"), "{words}");
    fs::remove_file(&copy).unwrap();
    let words = refused(&sandbox, "lambda", &copy);
    assert!(words.contains("No such file"), "{words}");
    assert_eq!(sandbox.leftovers(), Vec::<PathBuf>::new());
}

#[test]
fn a_kernel_that_goes_bad_after_the_first_start_is_done_without() {
    let Some(kernel) = object(ROBOT) else { return };
    let sandbox = Sandbox::new();
    let file = sandbox.make_root().join("kernel.so");
    fs::copy(kernel, &file).unwrap();
    let flags = ["--short-life", "0", "--kernel", file.to_str().unwrap()];
    let server = supervised(&sandbox, "worn", &flags);
    let mut asker = Asker::new(sandbox.connect("worn", Transport::Lane).unwrap());
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    let by_kernel = |asker: &Asker| asker.robot.statistics().unwrap().counts.by_kernel;
    // counted after the answer is on its way
    until("a count", || (by_kernel(&asker) == 1).then_some(()));
    let bits = asker.bits();
    fs::write(&file, "no kernel").unwrap();
    kill(serving(server.id()));
    let _ = until("an answer", || asker.ask().ok().filter(|one| one.status == Status::Ok));
    assert_eq!((asker.bits(), by_kernel(&asker)), (bits, 0));
    server.wait_for_line("no kernel of this version of sarrus");
    fs::remove_file(&file).unwrap();
    assert!(server.stop().success());
}

/// A server that makes kernels, with its cache in a folder.
fn auto(sandbox: &Sandbox, robot: &str, cache: &Path, compiler: Option<&str>) -> Server {
    let mut command = sandbox.command(robot, "auto", &["--kernel", "auto"]);
    command.env("XDG_CACHE_HOME", cache).envs(compiler.map(|compiler| ("CC", compiler)));
    sandbox.start(&mut command)
}

#[test]
fn kernels_are_made_beside_the_answers_and_kept_for_the_next_server() {
    if Compiler::found().is_none() {
        return println!("not run: no C compiler");
    }
    let sandbox = Sandbox::new();
    let name = format!("sarrus-auto-{}", std::process::id());
    let cache = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    for words in ["made in", "kept from before"] {
        let server = auto(&sandbox, "lambda", &cache, None);
        let mut generic = Asker::new(local("lambda"));
        // registering waits for no compiler
        let start = Instant::now();
        let mut served = Asker::new(sandbox.connect("auto", Transport::Lane).unwrap());
        assert_eq!(served.ask().unwrap().status, Status::Ok);
        println!("{words}: answered after {:?}", start.elapsed());
        server.wait_for_line(words);
        // the bits are the same before and after the kernel is swapped in
        compare(&mut generic, &mut served);
        // with one that was swapped in
        let by_kernel = |served: &Asker| served.robot.statistics().unwrap().counts.by_kernel;
        while by_kernel(&served) == 0 {
            compare(&mut generic, &mut served);
        }
        assert!(server.stop().success());
    }
    fs::remove_dir_all(&cache).unwrap();
}

#[test]
fn without_a_compiler_or_a_straight_line_the_generic_kernels_answer_and_that_is_said() {
    let sandbox = Sandbox::new();
    let cache = std::env::temp_dir().join(format!("sarrus-none-{}", std::process::id()));
    for (want, compiler, words) in [
        ("q", Some("/nonexistent/cc"), "no C compiler: set CC, or install cc"),
        ("residual", None, "`residual` is not generated"),
    ] {
        if compiler.is_none() && Compiler::found().is_none() {
            continue;
        }
        let server = auto(&sandbox, "lambda", &cache, compiler);
        let mut served = sandbox.connect("auto", Transport::Lane).unwrap();
        let query = served.query(sarrus_client::Request::Kinematics).given(["y"]).want([want]);
        let plan = query.prepare().unwrap();
        let line = server.wait_for_line(&format!("no kernel for kinematics of y for {want}: "));
        assert!(line.contains(words) && line.ends_with("; the generic ones answer"), "{line}");
        let mut numbers = vec![0.0; served.plan(plan).unwrap().want().len()];
        assert_eq!(served.ask(plan, &[0.1], &mut numbers).unwrap().status, Status::Ok);
        assert!(server.stop().success());
    }
    assert!(!cache.exists());
}

/// A script as the compiler, in a folder; `--version` is that of `cc`.
fn script(folder: &Path, text: &str) -> String {
    let path = folder.join("cc.sh");
    let head = "#!/bin/sh\n[ \"$1\" = --version ] && exec cc --version\n";
    fs::write(&path, format!("{head}{text}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o700)).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A compiler that adds a constructor to each object.
fn with_constructor(folder: &Path, body: &str) -> String {
    let more = folder.join("more.c");
    let code = format!("__attribute__((constructor)) static void f(void) {{ {body} }}");
    fs::write(&more, code).unwrap();
    script(folder, &format!("exec cc \"$@\" '{}'", more.display()))
}

/// A folder of one test.
fn folder(name: &str) -> PathBuf {
    let folder = format!("sarrus-{name}-{}", std::process::id());
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn an_object_that_crashes_or_hangs_leaves_its_query_without_a_kernel_and_ends_no_server() {
    if Compiler::found().is_none() {
        return println!("not run: no C compiler");
    }
    let sandbox = Sandbox::new();
    let folder = folder("crash");
    let trap = |folder: &Path| with_constructor(folder, "__builtin_trap();");
    let hang = |folder: &Path| with_constructor(folder, "for (volatile int k = 0;;) k = 1;");
    let sanitizer = |_: &Path| "cc -fsanitize=address".to_owned();
    let trials: [(&dyn Fn(&Path) -> String, &str); 3] = [
        (&sanitizer, "CC has -fsanitize=address"),
        (&trap, "tried in a process of its own: signal: "),
        (&hang, "tried in a process of its own: it was ended after 30 s"),
    ];
    for (compiler, words) in trials {
        let server = auto(&sandbox, "lambda", &folder, Some(&compiler(&folder)));
        let mut served = Asker::new(sandbox.connect("auto", Transport::Lane).unwrap());
        let line = server.wait_for_line("no kernel for ");
        assert!(line.contains(words) && line.ends_with("; the generic ones answer"), "{line}");
        assert_eq!(served.ask().unwrap().status, Status::Ok);
        assert!(server.stop().success());
    }
    fs::remove_dir_all(&folder).unwrap();
}

/// Whether a process is there and has not ended.
fn is_there(process: &str) -> bool {
    let state = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    !state.is_empty() && !state.contains(") Z ")
}

#[test]
fn a_hanging_object_delays_no_stop() {
    if Compiler::found().is_none() {
        return println!("not run: no C compiler");
    }
    let sandbox = Sandbox::new();
    let folder = folder("hang");
    let compiler = with_constructor(&folder, "for (volatile int k = 0;;) k = 1;");
    let server = auto(&sandbox, "lambda", &folder, Some(&compiler));
    let _served = Asker::new(sandbox.connect("auto", Transport::Lane).unwrap());
    let id = server.id().to_string();
    let trial = until("a trial", || {
        let entries = fs::read_dir("/proc").unwrap().flatten();
        let mut ids = entries.filter_map(|entry| entry.file_name().into_string().ok());
        ids.find(|process| {
            let read = |file| fs::read_to_string(format!("/proc/{process}/{file}"));
            let stat = read("stat").unwrap_or_default();
            stat.contains(&format!(") R {id} "))
                && read("cmdline").is_ok_and(|line| line.contains("--try-kernel"))
        })
    });
    assert!(server.stop().success());
    assert!(!is_there(&trial));
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn compilers_end_with_a_server_that_is_killed() {
    let sandbox = Sandbox::new();
    let folder = folder("orphans");
    let marker = folder.join("marker");
    let text = "sleep 1000 &\necho $$ $! > \"$0.new\"\nmv \"$0.new\" \"${0%/*}/marker\"\nwait";
    let compiler = script(&folder, text);
    let server = auto(&sandbox, "lambda", &folder, Some(&compiler));
    let _served = Asker::new(sandbox.connect("auto", Transport::Lane).unwrap());
    let words = until("a compiler", || fs::read_to_string(&marker).ok());
    server.kill();
    for process in words.split_whitespace() {
        until("the compiler's end", || (!is_there(process)).then_some(()));
    }
    fs::remove_dir_all(&folder).unwrap();
}

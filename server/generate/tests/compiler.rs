//! The C compiler as a program: how it is found, how it is ended.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request};
use sarrus_generate::{BuildError, Cache, Cancel, Compiler, MakeError, Source};
use sarrus_models::{Options, load};

#[test]
fn an_order_to_stop_ends_a_compiler_and_leaves_nothing() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("cancelled");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let [script, marker] = ["cc", "marker"].map(|name| folder.join(name));
    // prints its version; as a compiler it starts another program, reports where both are, and
    // waits
    let text = "#!/bin/sh\nif [ \"$2\" = --version ]; then echo \"slow $1\"; exit; fi\n\
                sleep 1000 &\necho $$ $! \"$TMPDIR\" > \"$1.new\"\nmv \"$1.new\" \"$1\"\nwait\n";
    fs::write(&script, text).unwrap();
    fs::set_permissions(&script, fs::Permissions::from_mode(0o700)).unwrap();
    // a command with an argument
    let command = format!("{} {}", script.display(), marker.display());
    let compiler = Compiler::named(&command, &Cancel::default()).unwrap();
    assert_eq!(compiler.name(), format!("slow {}", marker.display()));

    let cache = Cache::at(folder.join("kernels"));
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let query = Query::new(Request::InverseDynamics, given, FieldSet::of(&[Field::TauU]));
    let robot = sarrus_models::Source::Bundled("lambda".to_owned());
    let lambda = load(&robot, &Options::default()).unwrap().compiled.model;
    let plan = Plan::new(&lambda, &query).unwrap();
    let cancel = Cancel::default();
    let words = std::thread::scope(|scope| {
        let making = scope.spawn(|| cache.kernel(&lambda, &plan, &compiler, &cancel));
        let start = Instant::now();
        while !marker.exists() && !making.is_finished() && start.elapsed().as_secs() < 60 {
            std::thread::sleep(Duration::from_millis(5));
        }
        let words = fs::read_to_string(&marker);
        cancel.cancel();
        let error = making.join().unwrap().unwrap_err();
        assert!(matches!(error, MakeError::Build(BuildError::Cancelled)), "{error}");
        words.unwrap()
    });
    let [compiler, sleeper, temporary] = *words.split_whitespace().collect::<Vec<_>>() else {
        panic!("{words}")
    };
    assert!(temporary.contains("/.build-") && !Path::new(temporary).exists(), "{words}");
    let kept = Path::new(temporary).parent().unwrap();
    assert_eq!(fs::read_dir(kept).unwrap().count(), 0);
    for process in [compiler, sleeper] {
        // ended, or not yet waited for by the system
        let is_there = || {
            let state = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
            !state.is_empty() && !state.contains(") Z ")
        };
        let start = Instant::now();
        while is_there() && start.elapsed().as_secs() < 10 {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(!is_there(), "{process} of {words}");
    }
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_command_that_is_no_compiler_is_refused_with_the_reason() {
    let named = |command: &str| Compiler::named(command, &Cancel::default());
    let error = named("/nonexistent/cc -m64").unwrap_err().to_string();
    assert!(error.starts_with("/nonexistent/cc -m64: No such file"), "{error}");
    let error = named("false").unwrap_err().to_string();
    assert!(error.starts_with("false --version failed") && !error.contains('\n'), "{error}");
    let cancel = Cancel::default();
    cancel.cancel();
    let start = Instant::now();
    let error = Compiler::named("sh -c sleep${IFS}1000", &cancel).unwrap_err();
    assert!(matches!(error, BuildError::Cancelled) && start.elapsed().as_secs() < 10, "{error}");
}

#[test]
fn a_pipe_in_place_of_a_file_is_replaced() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("pipe");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("plain.c");
    let made = Command::new("mkfifo").arg(&path).status();
    assert!(made.unwrap().success());
    let text = || "int plain(void);\n".to_owned();
    let name = "plain".to_owned();
    let source = Source { name, header: text(), function: text(), test: text(), launcher: None };
    let files = Compiler::write(&source, &folder).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), text());
    assert_eq!((files.len(), fs::read_dir(&folder).unwrap().count()), (3, 3));
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_compiler_that_fails_without_a_word_or_says_too_much_has_a_reason() {
    let named = |command: &str| Compiler::named(command, &Cancel::default()).unwrap_err();
    let error = named("sh -c false").to_string();
    assert!(error.ends_with("exit status: 1"), "{error}");
    let start = Instant::now();
    let error = named("sh -c yes").to_string();
    assert!(error.contains("failed: y"), "{error}");
    assert!(start.elapsed().as_secs() < 10);
}

//! Compilers and objects that would harm the process that loads them.

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use sarrus_dynamics::Field;
use sarrus_generate::{
    BuildError, Cache, Cancel, Compiler, LoadError, LoadFault, MakeError, NativeKernel, Trial,
};

use super::{built, compiler, folder, model, plan};

/// A compiler that is a script: `--version` is that of `cc`, all else is up to `text`.
fn script(folder: &Path, text: &str) -> Compiler {
    let path = folder.join("cc.sh");
    let head = "#!/bin/sh\n[ \"$1\" = --version ] && exec cc --version\n";
    fs::write(&path, format!("{head}{text}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o700)).unwrap();
    Compiler::named(path.to_str().unwrap(), &Cancel::default()).unwrap()
}

/// Why there is no kernel.
fn error(cache: &Cache, compiler: &Compiler, cancel: &Cancel) -> MakeError {
    let lambda = model("lambda");
    cache.kernel(&lambda, &plan(&lambda, Field::TauU), compiler, cancel).unwrap_err()
}

fn good(_object: &Path) -> Command {
    let mut command = Command::new("echo");
    command.arg("compared");
    command
}

fn early(_object: &Path) -> Command {
    Command::new("true")
}

fn crashing(_object: &Path) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", "kill -SEGV $$"]);
    command
}

fn hanging(object: &Path) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", "echo > \"$0\"; sleep 1000"]).arg(object.with_file_name("begun"));
    command
}

#[test]
fn code_that_needs_another_library_is_refused_before_it_is_loaded() {
    if compiler().is_none() {
        return;
    }
    let folder = folder("needs");
    let instrumented = Compiler::named("cc -fsanitize=address", &Cancel::default()).unwrap();
    let error = error(&Cache::at(folder.join("kernels")), &instrumented, &Cancel::default());
    assert!(
        matches!(&error, MakeError::Build(BuildError::Flag(flag)) if flag.contains("address")),
        "{error}"
    );
    let lambda = model("lambda");
    let plan = plan(&lambda, Field::TauU);
    let path = built((&lambda, &plan), &folder, &["-pg"], |function| function);
    let error = NativeKernel::open(&path, &lambda, &plan).unwrap_err();
    assert!(
        matches!(&error.fault, LoadFault::Needs(symbol) if symbol.contains("count")),
        "{error}"
    );
}

#[test]
fn an_object_that_crashes_where_it_is_loaded_is_found_by_its_test_program() {
    if compiler().is_none() {
        return;
    }
    let folder = folder("crash");
    let more = folder.join("more.c");
    let code = "__attribute__((constructor)) static void f(void) { __builtin_trap(); }";
    fs::write(&more, code).unwrap();
    let compiler = script(&folder, &format!("exec cc \"$@\" '{}'", more.display()));
    let error = error(&Cache::at(folder.join("kernels")), &compiler, &Cancel::default());
    assert!(
        matches!(&error, MakeError::Build(BuildError::Failed { words, .. })
            if words.contains("signal")),
        "{error}"
    );
}

#[test]
fn only_an_object_that_another_process_has_survived_is_loaded() {
    let Some(compiler) = compiler() else { return };
    let folder = folder("trial");
    let of = |trial: Trial| Cache::at(folder.join("kernels")).tried_by(trial);
    let crashed = error(&of(crashing), &compiler, &Cancel::default());
    let is_found = |error: &MakeError| {
        matches!(error, MakeError::Load(LoadError { fault: LoadFault::Trial(reason), .. })
            if reason.starts_with("signal: 11"))
    };
    assert!(is_found(&crashed), "{crashed}");
    let ended = error(&of(early), &compiler, &Cancel::default());
    assert!(ended.to_string().contains("it ended early"), "{ended}");
    let lambda = model("lambda");
    let plan = plan(&lambda, Field::TauU);
    let made = of(good).kernel(&lambda, &plan, &compiler, &Cancel::default()).unwrap();
    // a kept one is tried again
    let crashed = error(&of(crashing), &compiler, &Cancel::default());
    assert!(is_found(&crashed), "{crashed}");
    // an order to stop ends a trial
    let cancel = Cancel::default();
    std::thread::scope(|scope| {
        let making = scope.spawn(|| error(&of(hanging), &compiler, &cancel));
        while !made.path.with_file_name("begun").exists() && !making.is_finished() {
            std::thread::sleep(Duration::from_millis(5));
        }
        cancel.cancel();
        let error = making.join().unwrap();
        assert!(matches!(error, MakeError::Build(BuildError::Cancelled)), "{error}");
    });
}

#[test]
fn the_output_of_a_compiler_is_read_only_where_it_is_a_file() {
    if compiler().is_none() {
        return;
    }
    let folder = folder("output");
    let other = folder.join("other");
    fs::write(&other, "of another program").unwrap();
    fs::set_permissions(&other, fs::Permissions::from_mode(0o640)).unwrap();
    let cache = Cache::at(folder.join("kernels")).tried_by(good);
    let to_other = format!("ln -s '{}'", other.display());
    for make in ["ln -s /dev/zero", "mkfifo", "mkdir", &to_other] {
        let text = format!("while [ \"$1\" != -o ]; do shift; done\nexec {make} \"$2\"");
        let error = error(&cache, &script(&folder, &text), &Cancel::default());
        assert!(
            matches!(error, MakeError::Load(LoadError { fault: LoadFault::NoFile, .. })),
            "{make}: {error}"
        );
    }
    let about = fs::metadata(&other).unwrap();
    assert_eq!((about.len(), about.mode() & 0o777), (18, 0o640));
}

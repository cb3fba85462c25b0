//! What the header of generated C says, and what happens to programs that include it.
#![allow(clippy::unwrap_used)]

use std::path::PathBuf;
use std::process::Command;

use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request};
use sarrus_generate::{Cancel, Compiler, Kernel, Source};
use sarrus_models::{Options, load};

fn model(robot: &str) -> Model<f64> {
    let source = sarrus_models::Source::Bundled(robot.to_owned());
    load(&source, &Options::default()).unwrap().compiled.model
}

fn source(model: &Model<f64>, query: &Query, name: &str) -> Source {
    let plan = Plan::new(model, query).unwrap();
    Source::new(&Kernel::trace(model, &plan).unwrap(), model, name)
}

#[test]
fn rows_for_another_number_of_lanes_do_not_link() {
    if Compiler::named("cc", &Cancel::default()).is_err() || cfg!(not(target_arch = "x86_64")) {
        println!("not run: no C compiler for x86-64");
        return;
    }
    let given = FieldSet::of(&[Field::Y]);
    let query = Query::new(Request::Kinematics, given, FieldSet::of(&[Field::Q]));
    let source = source(&model("lambda"), &query, "elbow");
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("lanes");
    Compiler::write(&source, &folder).unwrap();
    let text = "#include \"elbow.h\"\n\
                int main(void)\n{\n\
                \x20   double in[ELBOW_ROWS][ELBOW_INPUTS] = {{0.0}};\n\
                \x20   double out[ELBOW_ROWS][ELBOW_OUTPUTS];\n\
                \x20   return elbow_rows(in[0], out[0]) != 0;\n}\n";
    std::fs::write(folder.join("main.c"), text).unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new("cc");
        command.current_dir(&folder).args(["-std=c11", "-O1", "-DSARRUS_ROWS", "-Wno-psabi"]);
        command.args(arguments).output().unwrap().status.success()
    };
    if !run(&["-march=x86-64-v4", "-c", "elbow.c", "-o", "8.o"]) {
        println!("not run: the compiler does not know x86-64-v4");
        return;
    }
    assert!(run(&["-march=x86-64-v3", "-c", "elbow.c", "-o", "4.o"]));
    for (flag, fitting, other) in
        [("-march=x86-64-v3", "4.o", "8.o"), ("-march=x86-64-v4", "8.o", "4.o")]
    {
        assert!(run(&[flag, "main.c", fitting, "-o", "main", "-lm"]), "{flag}");
        assert!(!run(&[flag, "main.c", other, "-o", "main", "-lm"]), "{flag}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

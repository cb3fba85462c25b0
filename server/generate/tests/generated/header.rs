//! The header of generated C, and programs that include it.

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
        command.current_dir(&folder).args(["-std=c11", "-O1", "-DSARRUS_ROWS", "-Wall", "-Werror"]);
        command.args(arguments).output().unwrap().status.success()
    };
    // vectors that the processor does not have
    assert!(run(&["-march=x86-64", "-c", "elbow.c", "-o", "2.o"]));
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

/// The line of the header before the definition of a macro.
fn above<'a>(header: &'a str, name: &str) -> &'a str {
    let lines: Vec<&str> = header.lines().collect();
    let at = lines.iter().position(|line| line.starts_with(&format!("#define {name} "))).unwrap();
    lines[at - 1]
}

#[test]
fn fields_that_differ_in_case_alone_have_macros_of_their_own() {
    let given = FieldSet::of(&[Field::Y, Field::Yd]);
    let want = FieldSet::of(&[Field::G, Field::GU, Field::GUBias]);
    let query = Query::new(Request::Kinematics, given, want);
    let header = source(&model("lambda"), &query, "elbow").header;
    let line = |line: &str| header.lines().filter(|other| *other == line).count();
    assert_eq!(["G 0", "G_u 3", "g_u 4"].map(|x| line(&format!("#define ELBOW_OUT_{x}"))), [1; 3]);
    let mut names: Vec<&str> = header
        .lines()
        .filter_map(|line| line.strip_prefix("#define ELBOW_OUT_")?.split(' ').next())
        .collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names, ["G", "G_u", "g_u"], "{header}");
}

#[test]
fn the_header_names_rows_and_columns_in_their_order() {
    use Field::{FramePose, JacobianTree, Qd, TauY, Y, Yd, Ydd};
    let model = model("parallelogram");
    let info = model.info();
    let last = info.links.len() as u16 - 1;
    let given = FieldSet::of(&[Y, Yd]);
    let want = FieldSet::of(&[Qd, FramePose, JacobianTree]);
    // one joint of them, and frames against their order
    let query =
        Query::new(Request::Kinematics, given, want).with_frames(&[last, 1]).with_joints([1]);
    let header = source(&model, &query, "plane").header;
    let frames = [last, 1].map(|k| info.links[k as usize].as_str()).join(" ");
    let tree = info.tree.join(" ");
    assert_eq!(above(&header, "PLANE_OUT_QD"), format!("/* 1: {} */", info.tree[1]));
    let poses = "each its position, then its quaternion x y z w";
    assert_eq!(
        above(&header, "PLANE_OUT_FRAME_POSE"),
        format!("/* 2 x 7, row by row: {frames}; {poses} */")
    );
    let n = info.tree.len();
    assert_eq!(
        above(&header, "PLANE_OUT_JACOBIAN_TREE"),
        format!(
            "/* 12 x {n}, row by row: {frames}; each six rows, angular, then linear; columns: \
             {tree} */"
        )
    );
    assert_eq!(
        above(&header, "PLANE_IN_YD"),
        format!("/* {}: {} */", info.independent.len(), info.independent.join(" "))
    );

    let given = FieldSet::of(&[Y, Yd, Ydd]);
    let query = Query::new(Request::InverseDynamics, given, FieldSet::of(&[TauY]));
    let header = source(&model, &query.with_wrenches(&[last, 1]), "plane").header;
    let what = "each its moment, then its force";
    assert_eq!(
        above(&header, "PLANE_IN_WRENCHES"),
        format!("/* 2 x 6, row by row: {frames}; {what} */")
    );
}

//! Robots so light that the numbers of combined checks nearly reach their bound.

use std::path::PathBuf;

use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request};
use sarrus_generate::{Cancel, Compiler, Kernel, Source};
use sarrus_models::{Options, bundled_text, load};

/// Two four-bar linkages whose links are points of this mass.
fn linkages(mass: &str) -> Model<f64> {
    let (urdf, submechanisms) = bundled_text("four_bars_2").unwrap();
    let urdf = urdf.replace("0.08333333333333333", "0");
    let urdf = urdf.replace("mass value=\"1\"", &format!("mass value=\"{mass}\""));
    assert!(urdf.contains(mass));
    let source = sarrus_models::Source::Text {
        urdf: urdf.into_bytes(),
        submechanisms: Some(submechanisms.as_bytes().to_owned()),
    };
    load(&source, &Options::default()).unwrap().compiled.model
}

#[test]
fn rows_that_are_left_early_are_no_fault() {
    let Some(compiler) = Compiler::found() else {
        println!("not run: no C compiler");
        return;
    };
    let model = linkages("4e-13");
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::TauU]);
    let query = Query::new(Request::ForwardDynamics, given, FieldSet::of(&[Field::Ydd]));
    let plan = Plan::new(&model, &query).unwrap();
    let source = Source::new(&Kernel::trace(&model, &plan).unwrap(), &model, "light");
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("light");
    Compiler::write(&source, &folder).unwrap();
    let built = compiler.build(&source, &folder, &[], &Cancel::default()).unwrap();
    let words = built.test(&Cancel::default()).unwrap();
    assert!(words.contains("light_rows: left "), "{words}");
    // too many of them are left for calls of that function
    assert_eq!(built.load(&model, &plan).unwrap().rows(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}

//! The files of `sarrus export`, as the engines read them.

use std::path::PathBuf;
use std::{env, fs};

use sarrus_models::{Options, Source, Target, bundled, export, load};
use sarrus_report::peer::exported::{Deviation, Found, deviation, pythons};
use sarrus_tests::python::environment;

/// Largest difference of M, forces and loops, by size.
const ROUNDING: f64 = 1e-12;

/// Compares every bundled robot and the models of MJCF; the largest difference of accelerations by
/// the engine's own solver is at most `solver`.
fn agree(target: Target, engine: &str, ending: &str, solver: f64) {
    let python = match environment().has_optional_packages() {
        true => vec![environment().python().to_owned()],
        false => Vec::new(),
    };
    let python: Vec<PathBuf> = python.into_iter().chain(pythons()).collect();
    let folder = env::temp_dir().join(format!("sarrus_exported_{ending}_{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let of_mjcf = ["ankle", "gripper", "leg", "rules", "tied"].map(|name| {
        let file = format!("../models/tests/suite/mjcf/{name}.xml");
        let urdf = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(file);
        (name, Source::Files { urdf, submechanisms: None })
    });
    let all = bundled().map(|(name, _)| (name, Source::Bundled(name.to_owned())));
    let mut count = 0;
    for (name, source) in all.chain(of_mjcf) {
        let loaded = load(&source, &Options::default()).unwrap();
        let Ok(exported) = export(&loaded, target, name, false) else {
            println!("{name}: {target:?} cannot express it");
            continue;
        };
        for (ending, text) in &exported.files {
            fs::write(folder.join(format!("{name}{ending}")), text).unwrap();
        }
        let file = folder.join(format!("{name}.{ending}"));
        let found = deviation(&loaded.description, &exported.held, engine, &file, &python);
        match found.unwrap() {
            Deviation::NotRun(why) if why.contains("No module") || why.contains("other") => {
                println!("not run: {name}: {why}");
            }
            Deviation::NotRun(why) => panic!("{name}: {why}"),
            Deviation::Measured(Found { rows, .. }) => {
                println!("{name}: {rows:?}");
                // joints without mass follow others there; 2e-15 kg are no mass for a soft coupling
                let is_file = matches!(source, Source::Files { .. });
                let is_light =
                    engine == "MuJoCo" && is_file && ["gripper", "rules"].contains(&name);
                for row in &rows {
                    let most = match row.quantity.as_str() {
                        "accelerations" if is_light => f64::INFINITY,
                        "accelerations" => solver,
                        _ if is_light => 10.0 * ROUNDING,
                        _ => ROUNDING,
                    };
                    assert!(row.difference <= most, "{name}: {row:?}");
                    assert_eq!(row.is_finding(), most.is_infinite(), "{name}: {row:?}");
                }
                count += 1;
            }
        }
    }
    fs::remove_dir_all(folder).unwrap();
    println!("{engine}: {count} robots");
}

#[test]
fn mujoco_reads_the_same_robots_from_mjcf() {
    agree(Target::Mjcf, "MuJoCo", "xml", 0.5);
}

#[test]
fn pinocchio_reads_the_same_robots_from_its_files() {
    agree(Target::Pinocchio, "Pinocchio", "py", 1e-8);
}

#[test]
fn pinocchio_reads_the_same_robots_from_the_files_of_gepetto() {
    agree(Target::Gepetto, "Pinocchio", "yaml", 1e-8);
}

#[test]
fn drake_reads_the_same_trees_from_sdf() {
    agree(Target::Sdf, "Drake", "sdf", 0.0);
}

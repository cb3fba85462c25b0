//! The bundled robots and the reference files of users read without an error.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::{Path, PathBuf};

use sarrus_models::{LoadError, Loaded, Options, Source, bundled, load};

fn files(urdf: &Path, submechanisms: Option<&Path>) -> Result<Loaded, LoadError> {
    load(&Source::Files { urdf: urdf.to_owned(), submechanisms: submechanisms.map(Path::to_owned) }, &Options::default())
}

#[test]
fn survey() {
    let Some(reference) = std::env::var_os("SARRUS_REFERENCE").map(PathBuf::from) else { return };
    let h = reference.join("robots/hyrodyn");
    for (name, _) in bundled() {
        match load(&Source::Bundled(name.into()), &Options::default()) {
            Ok(l) => println!("OK {name} {}", l.report),
            Err(e) => println!("ERR {name}\n{e}"),
        }
    }
    let pairs = [
        ("leg/urdf/leg.urdf", "leg/urdf/submechanisms.yml"),
        ("leg/derived/leg_hip_knee.urdf", "leg/derived/leg_hip_knee.yml"),
        ("leg/derived/leg_hip_knee.urdf", "leg/derived/leg_hip_knee_numerical.yml"),
        ("leg/derived/LLAnkle.urdf", ""), ("leg/derived/LLHip3.urdf", ""), ("leg/derived/LLKnee.urdf", ""),
        ("leg/smurf/leg.smurf", ""),
        ("rh5v2/derived/RH5v2.urdf", "rh5v2/derived/submechanisms_full_hybrid.yml"),
        ("rh5v2/derived/RH5v2.urdf", "rh5v2/derived/submechanisms_full_numerical.yml"),
        ("rh5v2/derived/RH5v2.urdf", "rh5v2/submechanisms/submechanisms.yml"),
        ("rh5v2/derived/RH5v2.urdf", "rh5v2/submechanisms/submechanisms.c2942da.yml"),
        ("rh5v2/urdf/RH5v2_floatingbase.urdf", "rh5v2/submechanisms/submechanisms_floatingbase.yml"),
        ("rh5v2/derived/Body.urdf", "rh5v2/submechanisms/body_submechanism.yml"),
        ("rh5v2/derived/submechanisms_reduced.urdf", "rh5v2/derived/submechanisms_reduced.yml"),
        ("rh5v2/derived/submechanisms_reduced.urdf", "rh5v2/derived/submechanisms_reduced_numerical.yml"),
        ("rh5v2/derived/submechanisms_reduced.urdf", "rh5v2/derived/submechanisms_reduced_hybrid_elbows_numerical.yml"),
        ("rh5v2/derived/submechanisms_reduced.urdf", "rh5v2/derived/submechanisms_reduced_hybrid_torso_numerical.yml"),
        ("rh5v2/derived/submechanisms_reduced.urdf", "rh5v2/submechanisms/submechanisms_reduced_numerical.yml"),
        ("rh5v2/derived/Head.urdf", ""), ("rh5v2/derived/ALElbow.urdf", ""), ("rh5v2/derived/left_wrist_mechanism.urdf", ""),
        ("rh5v2/derived/RH5v2.urdf", ""),
        ("leg/urdf/leg.urdf", "leg/urdf/joint_limits.yml"),
    ];
    for (u, y) in pairs {
        let y = (!y.is_empty()).then(|| h.join(y));
        match files(&h.join(u), y.as_deref()) {
            Ok(l) => println!("OK {u} {y:?}\n{}", l.report),
            Err(e) => println!("ERR {u} {y:?}\n{e}"),
        }
    }
}

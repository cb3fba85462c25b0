//! Compilers that fuse a multiplication and an addition which are two in the plan.

use std::path::{Path, PathBuf};

use sarrus_dynamics::description::Inertial;
use sarrus_dynamics::{DescriptionBuilder, Field, FieldSet, LinkId, Model, Plan, Query, Request};
use sarrus_generate::{Cancel, Compiler, Kernel, LoadError, LoadFault, NativeKernel, Source};

/// Two joints across each other: sums and differences of products side by side, of which gcc 12
/// makes `vfmaddsub`.
fn two_joints() -> Model<f64> {
    let mut robot = DescriptionBuilder::new("two");
    let bob = |at: [f64; 3]| Inertial::new(1.0, at, [0.01, 0.0, 0.0, 0.01, 0.0, 0.01]);
    let first = robot.revolute("j1", LinkId::BASE, [-1.0, 0.0, 0.0]).rpy([0.0, 0.0, -0.7]);
    let first = first.limits(-2.0, 2.0).inertial(bob([0.0, 0.0, 0.1])).link();
    let second = robot.revolute("j2", first, [0.0, 0.0, -1.0]).origin([1.0, 1.0, 0.0]);
    second.limits(-2.0, 2.0).inertial(bob([0.0, 0.2, 0.0])).link();
    robot.compile().unwrap().model
}

/// A serial arm whose numbers come from a seed.
fn arm(seed: u64) -> Model<f64> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut robot = DescriptionBuilder::new(format!("arm {seed}"));
    let mut link = LinkId::BASE;
    for k in 0..2 + random.usize(0..3) {
        let mut three = || [(); 3].map(|()| (20.0 * random.f64() - 10.0).round() / 10.0);
        let origin = three();
        let rpy = three();
        let at = three();
        let axis = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]][random.usize(0..3)];
        let bob = Inertial::new(1.0 + random.f64(), at, [0.02, 0.0, 0.0, 0.03, 0.0, 0.04]);
        let joint = robot.revolute(format!("joint{k}"), link, axis).origin(origin).rpy(rpy);
        link = joint.limits(-2.0, 2.0).inertial(bob).link();
    }
    robot.compile().unwrap().model
}

/// Poses of the last link, or forces.
fn plans(model: &Model<f64>) -> [(&'static str, Plan); 2] {
    let last = model.info().links.len() as u16 - 1;
    let of = |request, given: &[Field], want| {
        Query::new(request, FieldSet::of(given), FieldSet::of(&[want]))
    };
    let pose = of(Request::Kinematics, &[Field::Y], Field::FramePose).with_frames(&[last]);
    let given = [Field::Y, Field::Yd, Field::Ydd];
    let force = of(Request::InverseDynamics, &given, Field::TauU);
    [("pose", pose), ("force", force)]
        .map(|(name, query)| (name, Plan::new(model, &query).unwrap()))
}

fn loaded(
    compiler: &Compiler,
    (model, plan, name): (&Model<f64>, &Plan, &str),
    folder: &Path,
    flags: &[&str],
) -> Result<NativeKernel, LoadError> {
    let source = Source::new(&Kernel::trace(model, plan).unwrap(), model, name);
    Compiler::write(&source, folder).unwrap();
    compiler.build(&source, folder, flags, &Cancel::default()).unwrap().load(model, plan)
}

#[test]
fn no_compiler_here_fuses_what_is_two_operations_in_the_plan() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fused");
    for command in ["gcc", "clang"] {
        let Ok(compiler) = Compiler::named(command, &Cancel::default()) else {
            println!("not run: no {command}");
            continue;
        };
        let folder = folder.join(command);
        let models = [two_joints()].into_iter().chain((0..2).map(arm));
        for (k, model) in models.enumerate() {
            for (what, plan) in plans(&model) {
                let name = format!("arm{k}_{what}");
                let of = (&model, &plan, name.as_str());
                let kernel = loaded(&compiler, of, &folder, &[]);
                assert!(kernel.is_ok(), "{command}, {name}: {}", kernel.unwrap_err());
                // without the flag it is refused where the compiler does so; others have their
                // reasons
                match loaded(&compiler, of, &folder, &["-ftree-slp-vectorize"]) {
                    Ok(_) => println!("{command}, {name}: not fused"),
                    Err(error) => {
                        println!("{command}, {name}: {error}");
                        assert!(matches!(error.fault, LoadFault::Differs { .. }), "{error}");
                        assert!(error.to_string().contains("-fno-tree-slp-vectorize"), "{error}");
                    }
                }
            }
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

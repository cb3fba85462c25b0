//! Shared objects: loading, refusals with their reasons, keeping.
#![allow(clippy::unwrap_used, clippy::panic)]

mod fused;
mod light;
mod trial;

use std::fs;
use std::hint::black_box;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant, SystemTime};

use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Status, Workspace};
use sarrus_generate::{
    Cache, CacheError, Cancel, Compiler, FLAGS, Kernel, LoadError, LoadFault, MakeError,
    NativeKernel, ObjectFile, Origin, RandomInputs, Source, random_input,
};
use sarrus_models::{Options, load};

fn model(robot: &str) -> Model<f64> {
    let source = sarrus_models::Source::Bundled(robot.to_owned());
    load(&source, &Options::default()).unwrap().compiled.model
}

/// Inverse dynamics, for actuator forces or others.
fn plan(model: &Model<f64>, want: Field) -> Plan {
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let query = Query::new(Request::InverseDynamics, given, FieldSet::of(&[want]));
    Plan::new(model, &query).unwrap()
}

/// A folder of one test, gone at its end.
struct Folder(PathBuf);

impl std::ops::Deref for Folder {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn folder(name: &str) -> Folder {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    Folder(folder)
}

fn compiler() -> Option<Compiler> {
    let compiler = Compiler::found();
    if compiler.is_none() {
        println!("not run: no C compiler");
    }
    compiler
}

/// The shared object of a plan, after a change of its C.
fn built(
    (model, plan): (&Model<f64>, &Plan),
    folder: &Path,
    flags: &[&str],
    change: impl Fn(String) -> String,
) -> PathBuf {
    let mut source = Source::new(&Kernel::trace(model, plan).unwrap(), model, "elbow");
    source.function = change(source.function);
    Compiler::write(&source, folder).unwrap();
    let path = Compiler::found()
        .unwrap()
        .build(&source, folder, flags, &Cancel::default())
        .unwrap()
        .library;
    fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
    path
}

/// The twelfth digit of the first number of the function with so many is another one: the sine of
/// some angle.
fn with_another_constant(function: String) -> String {
    let is_digit = |c: &char| c.is_ascii_digit();
    let start = function.find(" int elbow(").unwrap();
    let places = function.match_indices("0.").map(|(at, _)| at + 2).filter(|at| *at > start);
    let is_long = |at: &usize| function[*at..].chars().take_while(is_digit).count() >= 12;
    let at = places.into_iter().find(is_long).unwrap();
    let end = at + 12;
    let digit = if &function[end - 1..end] == "7" { "3" } else { "7" };
    format!("{}{digit}{}", &function[..end - 1], &function[end..])
}

#[test]
fn a_loaded_kernel_has_the_bits_of_the_plan_and_leaves_it_what_it_cannot_answer() {
    if compiler().is_none() {
        return;
    }
    let model = model("lambda");
    let plan = plan(&model, Field::TauU);
    let folder = folder("answers");
    let path = built((&model, &plan), &folder, &[], |function| function);
    let kernel = NativeKernel::open(&path, &model, &plan).unwrap();
    let manifest = kernel.manifest();
    assert_eq!((manifest.robot.as_str(), manifest.function.as_str()), (model.name(), "elbow"));
    assert!(manifest.compiler.contains('.'), "{manifest:?}");
    // the file may be replaced: the loaded object stays
    fs::write(&path, "nothing").unwrap();
    let mut workspace = Workspace::for_plans(&model, [&plan]);
    let mut found = [0.0];
    let mut expected = [0.0];
    let mut answered = 0;
    for k in 0..10_000 {
        let mut input = random_input(model.info(), plan.given(), 77_000_000 + k);
        // NaN is left to the plan
        if k % 10 == 0 {
            input[1] = f64::NAN;
        }
        let right = plan.run(&model, &mut workspace, &input, &mut expected);
        if let Some(answer) = kernel.answer((&model, &plan), &mut workspace, &input, &mut found) {
            assert_eq!((answer, found[0].to_bits()), (right, expected[0].to_bits()));
            answered += 1;
        }
    }
    assert!((5_000..=9_000).contains(&answered), "{answered}");
    let mut answer = |input: &[f64], found: &mut [f64]| {
        kernel.answer((&model, &plan), &mut workspace, input, found)
    };
    assert!(answer(&[f64::NAN, 0.1, 0.1], &mut found).is_none());
    // of other sizes it is not called
    assert!(answer(&[0.1, 0.1], &mut found).is_none());
    assert!(answer(&[0.1, 0.1, 0.1], &mut []).is_none());
}

#[test]
fn what_is_not_the_kernel_of_a_plan_is_refused_with_the_reason() {
    if compiler().is_none() {
        return;
    }
    let lambda = model("lambda");
    let other = model("parallelogram");
    let own = plan(&lambda, Field::TauU);
    let folder = folder("refused");
    let path = built((&lambda, &own), &folder, &[], |function| function);
    let open = |path: &Path| NativeKernel::open(path, &lambda, &own).unwrap_err();

    // for another robot, for another query
    let error = NativeKernel::open(&path, &other, &plan(&other, Field::TauU)).unwrap_err();
    assert!(matches!(error.fault, LoadFault::WrongRobot { .. }), "{error}");
    let error = NativeKernel::open(&path, &lambda, &plan(&lambda, Field::TauY)).unwrap_err();
    assert!(matches!(error.fault, LoadFault::WrongQuery), "{error}");

    // not there, no file, no object, half an object, a description alone, another version
    let error = open(&folder.join("nothing.so"));
    assert!(matches!(error.fault, LoadFault::Io(_)), "{error}");
    let error = open(&folder);
    assert!(matches!(error.fault, LoadFault::NoFile), "{error}");
    let bytes = fs::read(&path).unwrap();
    let damaged = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        fs::write(&path, bytes).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        open(&path)
    };
    let error = damaged("text.so", b"no object");
    assert!(matches!(error.fault, LoadFault::NoKernel), "{error}");
    for part in [16, 100, 1000, bytes.len() / 2, bytes.len() - 1] {
        let error = damaged("half.so", &bytes[..part]);
        assert!(matches!(error.fault, LoadFault::NoKernel | LoadFault::Broken), "{error}");
    }
    let head = b"sarrus kernel 6\n";
    let at = bytes.windows(head.len()).position(|window| window == head).unwrap();
    let error = damaged("manifest.so", &bytes[at..]);
    assert!(matches!(error.fault, LoadFault::Broken), "{error}");
    let mut later = bytes.clone();
    later[at + head.len() - 2] = b'7';
    let error = damaged("later.so", &later);
    assert!(matches!(error.fault, LoadFault::NoKernel), "{error}");

    // for a processor that does not exist
    let place = bytes.windows(5).position(|window| window == b"avx2 ");
    if let Some(at) = place {
        let mut newer = bytes.clone();
        newer[at + 3] = b'9';
        let error = damaged("newer.so", &newer);
        let LoadFault::Processor(missing) = &error.fault else { panic!("{error}") };
        assert_eq!(missing, "avx9");
    }
    let needed = &ObjectFile::read(&path).unwrap().manifest().processor.clone();
    let is_built_for_it = FLAGS.contains(&"-march=x86-64-v3");
    assert_eq!((needed.contains("fma avx2"), place.is_some()), (is_built_for_it, is_built_for_it));

    // others may write it
    fs::set_permissions(&path, fs::Permissions::from_mode(0o664)).unwrap();
    let error = open(&path);
    assert!(matches!(error.fault, LoadFault::Writable(0o664)), "{error}");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
    assert!(ObjectFile::read(&path).is_ok());
}

#[test]
fn a_kernel_with_other_bits_is_refused_with_a_state() {
    if compiler().is_none() {
        return;
    }
    let lambda = model("lambda");
    let plan = plan(&lambda, Field::TauU);
    let folder = folder("bits");
    let of = |name: &str| folder.join(name);
    // a constant of the robot
    let path = built((&lambda, &plan), &of("constant"), &[], with_another_constant);
    let error = NativeKernel::open(&path, &lambda, &plan).unwrap_err();
    assert!(matches!(error.fault, LoadFault::Differs { .. }), "{error}");
    // a number of rows alone; where one of them is always left they are answered one by one
    let change = |from: &'static str, to: &'static str| {
        let change = |function: String| function.replace(from, to);
        let path = built((&lambda, &plan), &of("rows"), &[], change);
        NativeKernel::open(&path, &lambda, &plan)
    };
    let put = "sarrus_put(out, 0, 1, ";
    let error = change(put, "sarrus_put(out, 0, 1, 1.000000000001 * ").unwrap_err();
    assert!(matches!(&error.fault, LoadFault::Differs { what, .. } if what.contains("row")));
    assert!(change(put, put).unwrap().rows() >= 4);
    let left = change("return sarrus_bits_of(", "return 2 | sarrus_bits_of(").unwrap();
    assert_eq!(left.rows(), 1);
    let silent = |function: String| {
        let function = function.replace("return sarrus_bits_of(", "return -1 | sarrus_bits_of(");
        function.replace("return (int)(", "return 2 | (int)(")
    };
    let path = built((&lambda, &plan), &of("silent"), &[], silent);
    let error = NativeKernel::open(&path, &lambda, &plan).unwrap_err();
    assert!(matches!(error.fault, LoadFault::Unserved(_)), "{error}");
}

/// Whether the half of the smallest normal number is a number here.
fn has_small_numbers() -> bool {
    black_box(f64::MIN_POSITIVE) * black_box(0.5) > 0.0
}

#[test]
fn an_object_that_changes_rounding_changes_it_in_no_thread_but_its_own() {
    if compiler().is_none() {
        return;
    }
    let lambda = model("lambda");
    let plan = plan(&lambda, Field::TauU);
    let folder = folder("fast");
    // with the start-up code that turns small numbers into zeros, where the compiler has it
    let path = built((&lambda, &plan), &folder, &["-ffast-math"], |function| function);
    let (ask, asked) = channel();
    let earlier = std::thread::spawn(move || {
        asked.recv().unwrap();
        has_small_numbers()
    });
    assert!(has_small_numbers());
    let error = NativeKernel::open(&path, &lambda, &plan).unwrap_err();
    let is_right = matches!(error.fault, LoadFault::Differs { .. } | LoadFault::ChangesRounding);
    assert!(is_right, "{error}");
    assert!(has_small_numbers(), "{error}");
    ask.send(()).unwrap();
    assert!(earlier.join().unwrap(), "{error}");
    assert!(std::thread::spawn(has_small_numbers).join().unwrap(), "{error}");
}

#[test]
fn what_was_made_once_is_kept_and_what_was_changed_is_made_again() {
    let Some(compiler) = compiler() else { return };
    let folder = folder("kept");
    let cache = Cache::at(folder.join("kernels"));
    let lambda = model("lambda");
    let plan = plan(&lambda, Field::TauU);
    assert!(matches!(cache.find(&lambda, &plan), Err(MakeError::NotKept)));
    let make = || cache.kernel(&lambda, &plan, &compiler, &Cancel::default()).unwrap();
    let made = make();
    assert!(matches!(made.origin, Origin::Made { refused: None, .. }), "{made:?}");
    assert!(matches!(make().origin, Origin::Kept));
    assert!(cache.find(&lambda, &plan).is_ok());

    // no other user can write it, and nothing else is left
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    let compiled = made.path.parent().unwrap();
    assert_eq!([mode(cache.folder()), mode(compiled), mode(&made.path)], [0o700, 0o700, 0o600]);
    assert_eq!(fs::read_dir(compiled).unwrap().count(), 1);

    // damaged: made again, with the reason
    fs::write(&made.path, "nothing").unwrap();
    let again = make();
    let Origin::Made { refused: Some(error), .. } = again.origin else { panic!("{again:?}") };
    assert!(matches!(error.fault, LoadFault::NoKernel), "{error}");
    assert!(matches!(make().origin, Origin::Kept));

    // one bit of it, anywhere: nothing of it is loaded
    let bytes = fs::read(&made.path).unwrap();
    let description = bytes.windows(14).position(|window| window == b"sarrus kernel ").unwrap();
    for place in [bytes.len() / 3, bytes.len() / 2, bytes.len() - 2] {
        // in the description it would be of another robot first
        let is_described = (description..description + 500).contains(&place);
        let place = if is_described { description + 500 } else { place };
        let mut other = bytes.clone();
        other[place] ^= 1;
        fs::write(&made.path, other).unwrap();
        let error = cache.find(&lambda, &plan).unwrap_err();
        assert!(
            matches!(error, MakeError::Load(LoadError { fault: LoadFault::Damaged, .. })),
            "{error}"
        );
    }
    assert!(matches!(
        make().origin,
        Origin::Made { refused: Some(LoadError { fault: LoadFault::Damaged, .. }), .. }
    ));

    // the object used last is the newest, and leftovers of an ended process go at once or after an
    // hour
    let long_ago = SystemTime::now() - Duration::from_secs(7200);
    let old = |path: &Path| fs::File::open(path).unwrap().set_modified(long_ago).unwrap();
    old(&made.path);
    assert!(matches!(make().origin, Origin::Kept));
    assert!(fs::metadata(&made.path).unwrap().modified().unwrap() > long_ago);
    let [abandoned, recent] = [".build-1", ".build-2"].map(|name| compiled.join(name));
    let unlocked = compiled.join(".build-3");
    [&abandoned, &recent, &unlocked].iter().for_each(|path| fs::create_dir(path).unwrap());
    old(&abandoned);
    fs::write(unlocked.join("lock"), "").unwrap();
    fs::remove_file(&made.path).unwrap();
    fs::create_dir(&made.path).unwrap();
    make();
    let left = [&abandoned, &recent, &unlocked].map(|path| path.exists());
    assert_eq!((left, made.path.is_file()), ([false, true, false], true));

    // a folder that others may write is not used, nor one below it, by whatever name; a sticky one
    // is
    let refuses = |cache: &Cache, found: &Path| match cache.find(&lambda, &plan) {
        Err(MakeError::Cache(CacheError::Open(path) | CacheError::Above(path))) => path == found,
        _ => false,
    };
    let set = |path: &Path, mode| {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    };
    let linked = Cache::at(folder.join("link/below"));
    fs::create_dir_all(folder.join("above/inner")).unwrap();
    fs::rename(cache.folder(), folder.join("above/inner/below")).unwrap();
    std::os::unix::fs::symlink("above/inner", folder.join("link")).unwrap();
    let named = Cache::at(folder.join("above/inner/below"));
    for open in [folder.join("above"), folder.join("above/inner")] {
        set(&open, 0o777);
        assert!(refuses(&named, &open) && refuses(&linked, &open));
        set(&open, 0o1777);
        assert!(named.find(&lambda, &plan).is_ok() && linked.find(&lambda, &plan).is_ok());
        set(&open, 0o755);
    }
    set(named.folder(), 0o777);
    assert!(refuses(&named, named.folder()) && refuses(&linked, linked.folder()));
}

/// Nanoseconds of a call, the least of several runs.
fn ns(best: &mut f64, calls: usize, mut call: impl FnMut(usize)) {
    let start = Instant::now();
    (0..calls).for_each(&mut call);
    *best = best.min(start.elapsed().as_nanos() as f64 / calls as f64);
}

#[test]
#[ignore = "compiles large functions"]
fn kernels_of_every_size_have_the_bits_of_their_plans_and_their_times_are_printed() {
    use Field::*;
    let Some(compiler) = compiler() else { return };
    let folder = folder("times");
    let cache = Cache::at(folder.join("kernels"));
    let queries = [
        ("state", Request::Kinematics, [Y, Yd, Ydd], [Q, Qd, Qdd].as_slice()),
        ("inverse", Request::InverseDynamics, [Y, Yd, Ydd], &[TauU]),
        ("forward", Request::ForwardDynamics, [Y, Yd, TauU], &[Ydd]),
    ];
    for robot in ["lambda", "torso", "wrist", "rh5v2_upper_body", "rh5v2_full"] {
        let model = model(robot);
        for (name, request, given, want) in &queries {
            let query = Query::new(*request, FieldSet::of(given), FieldSet::of(want));
            let plan = Plan::new(&model, &query).unwrap();
            let kernel = cache.kernel(&model, &plan, &compiler, &Cancel::default()).unwrap().kernel;
            let mut inputs = RandomInputs::new(&model, &plan);
            let mut workspace = Workspace::for_plans(&model, [&plan]);
            let [mut found, mut expected] = [(); 2].map(|()| vec![0.0; plan.want().len()]);
            // how long a failure takes is another question
            let mut is_answered = |input: &Vec<f64>| {
                let answer = plan.run(&model, &mut workspace, input, &mut expected);
                answer.status == Status::Ok
            };
            let inputs = (0..5000).map(|k| inputs.input(k)).filter(&mut is_answered);
            let inputs: Vec<Vec<f64>> = inputs.take(1000).collect();
            let mut left = 0;
            for input in &inputs {
                let right = plan.run(&model, &mut workspace, input, &mut expected);
                match kernel.answer((&model, &plan), &mut workspace, input, &mut found) {
                    Some(answer) => {
                        assert_eq!(answer, right);
                        let pairs = found.iter().zip(&expected);
                        pairs.for_each(|(a, b)| assert_eq!(a.to_bits(), b.to_bits()));
                    }
                    None => left += 1,
                }
            }
            // how long one takes that is left to the plan is another question
            let mut is_served = |input: &&Vec<f64>| {
                kernel.answer((&model, &plan), &mut workspace, input, &mut found).is_some()
            };
            let served: Vec<&Vec<f64>> = inputs.iter().filter(&mut is_served).collect();
            // by turns, so that other load disturbs both
            let [mut generic, mut generated] = [f64::INFINITY; 2];
            for _ in 0..40 {
                let out = &mut expected;
                ns(&mut generic, 2000, |k| {
                    let input = served[k % served.len()];
                    let _ = black_box(plan.run(&model, &mut workspace, input, out));
                });
                ns(&mut generated, 2000, |k| {
                    let input = served[k % served.len()];
                    let answer = kernel.answer((&model, &plan), &mut workspace, input, &mut found);
                    if black_box(answer).is_none() {
                        let _ = black_box(plan.run(&model, &mut workspace, input, &mut found));
                    }
                });
            }
            println!(
                "{robot} {name}: {generic:.0} ns by the plan, {generated:.0} ns with its kernel, \
                 which leaves {left} of 1000 states to it"
            );
        }
    }
}

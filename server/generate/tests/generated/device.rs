//! Kernels for devices: the bits of the plans on OpenCL, registers and spills of CUDA.

use std::process::Command;

use sarrus_dynamics::Plan;
use sarrus_generate::{Cancel, Compiler, Device, Kernel, Outcome, Source};

use super::{Comparison, answers, folder, model, queries, states, warm_queries};

/// The name of a source whose files are in a folder, and the output of its launcher.
fn launched(
    robot: &str,
    (name, query): (&str, sarrus_dynamics::Query),
    device: Device,
) -> (String, String) {
    let model = model(robot);
    let kernel = Kernel::trace(&model, &Plan::new(&model, &query).unwrap()).unwrap();
    let source = Source::of_device(&kernel, &model, &format!("{robot}_{name}"), device);
    let folder = folder(&format!("{device:?}"));
    Compiler::write(&source, &folder).unwrap();
    let words = source.launched(&folder, &Cancel::default()).unwrap().unwrap();
    println!("{robot} {name}: {words}");
    (source.name, words)
}

#[test]
fn opencl_has_the_bits_of_the_plans() {
    let count = 10_000;
    let warm = ("wrist", ("warm", warm_queries()[1].1));
    let robots = ["lambda", "torso", "parallelogram", "r3_lambda_r"];
    let plain = robots.into_iter().flat_map(|robot| queries().map(|query| (robot, query)));
    for (robot, query) in plain.chain([("rh5v2_upper_body", queries()[1]), warm]) {
        let (source, words) = launched(robot, query, Device::OpenCl);
        if words.starts_with("not run") {
            return;
        }
        assert!(words.contains("16384 states, 0 left, the same bits"), "{words}");
        let model = model(robot);
        let plan = Plan::new(&model, &query.1).unwrap();
        let mut comparison = Comparison::new(&model, &plan);
        let of = |input: Vec<f64>| Some((comparison.closed(&input)?, input));
        let states: Vec<_> = states(&model, &plan, 0..count).filter_map(of).collect();
        let closed: Vec<Vec<f64>> = states.iter().map(|state| state.0.clone()).collect();
        let folder = folder("OpenCl");
        let mut command = Command::new(folder.join(format!("{source}_launch")));
        command.current_dir(folder);
        let answers = answers(command, "states", &closed, plan.want().len());
        for ((_, input), (outcome, output)) in states.iter().zip(answers) {
            assert!(outcome != Outcome::NotAnswered || output.iter().all(|x| x.is_nan()));
            comparison.compare(input, outcome, &output);
        }
        let answered = comparison.compared.answered;
        println!("{robot} {}: {answered} of {} answered", query.0, states.len());
        assert!(answered as usize * 2 > states.len(), "{answered}");
    }
}

#[test]
fn cuda_is_compiled_with_few_spills() {
    // bytes that a thread may store for want of registers: half of those in the order of the plan
    for (robot, query, most) in
        [("torso", queries()[1], 0), ("rh5v2_upper_body", queries()[1], 960)]
    {
        let (_, words) = launched(robot, query, Device::Cuda);
        let spills = words.split(" bytes spill stores").next().unwrap_or_default();
        match spills.rsplit(' ').next().unwrap_or_default().parse::<u64>() {
            Ok(spilled) => assert!(spilled <= most, "{words}"),
            Err(_) => assert!(words.starts_with("not run"), "{words}"),
        }
    }
}

//! JavaScript against the generic kernels: every bit, in node.

use std::process::Command;

use sarrus_dynamics::Plan;
use sarrus_generate::{Cancel, Kernel, Outcome, Script};

use crate::{Comparison, OTHERS, ROBOTS, answers, folder, model, queries, states};

/// `SARRUS_STATES`: states of each query on every robot, instead of a few on some.
fn asked() -> Option<u64> {
    std::env::var("SARRUS_STATES").ok()?.parse().ok()
}

#[test]
fn javascript_has_the_bits_of_the_plans() {
    let few = ["lambda", "parallelogram", "r3_lambda_r", "bricard"];
    let robots = match asked() {
        Some(_) => ROBOTS.into_iter().chain(OTHERS).collect(),
        None => few.to_vec(),
    };
    let count = asked().unwrap_or(64);
    for robot in robots {
        let model = model(robot);
        for (name, query) in queries() {
            let plan = Plan::new(&model, &query).unwrap();
            let kernel = Kernel::trace(&model, &plan).unwrap();
            let script = Script::new(&kernel, &model, &format!("{robot}_{name}"));
            let folder = folder("js");
            let files = script.write(&folder).unwrap();
            let Some(words) = script.test(&folder, &Cancel::default()).unwrap() else {
                println!("not run: no node");
                return;
            };
            let mut comparison = Comparison::new(&model, &plan);
            let given = states(&model, &plan, 0..count);
            let of = |input: Vec<f64>| Some((comparison.closed(&input)?, input));
            let (closed, given): (Vec<_>, Vec<_>) = given.filter_map(of).unzip();
            let mut node = Command::new("node");
            node.arg(&files[1]);
            let answers = answers(node, "states", &closed, plan.want().len());
            let mut output = vec![0.0; kernel.outputs()];
            for ((closed, input), (outcome, numbers)) in closed.iter().zip(&given).zip(answers) {
                assert_eq!(outcome, kernel.evaluate(closed, &mut output), "{input:?}");
                let pairs = output.iter().zip(&numbers);
                let is_same = pairs.clone().all(|(a, b)| a.to_bits() == b.to_bits());
                assert!(is_same || outcome == Outcome::NotAnswered, "{output:?} {numbers:?}");
                comparison.compare(input, outcome, &numbers);
            }
            let answered = comparison.compared.answered;
            println!("{words}; {answered} of {count} answered, {} closed", closed.len());
            assert!(answered > 0);
        }
    }
}

//! JavaScript against the generic kernels: every bit, in node.

use std::process::Command;

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_generate::{Cancel, Kernel, Outcome, RandomInputs, Script, sigma_min};
use sarrus_models::{Options, Source, load};

use crate::{Comparison, FRESH, OTHERS, ROBOTS, answers, folder, model, queries, states};

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

/// The largest deviation of each field from another answer, by the field's size.
fn deviation(plan: &Plan, found: &[f64], expected: &[f64]) -> f64 {
    let of = |slot: &sarrus_dynamics::Slot| {
        let expected = &expected[slot.range()];
        let size = expected.iter().fold(1e-300, |size: f64, x| size.max(x.abs()));
        let pairs = found[slot.range()].iter().zip(expected);
        pairs.fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs() / size))
    };
    plan.want().slots().iter().map(of).fold(0.0, f64::max)
}

#[test]
fn javascript_closes_loops_by_newtons_method_as_the_plans_do() {
    let robots = match asked() {
        Some(_) => OTHERS.to_vec(),
        None => vec!["five_bar", "bricard", "delta"],
    };
    let count = asked().unwrap_or(64);
    for robot in robots {
        let source = Source::Bundled(robot.to_owned());
        let compiled = load(&source, &Options::default()).unwrap().compiled;
        let model = &compiled.model;
        let [_, (_, mut query), _] = queries();
        query.given |= Field::QGuess;
        query.want |= Field::Q;
        let plan = Plan::new(model, &query).unwrap();
        let kernel = Kernel::trace_for_display(model, &plan).unwrap();
        let script = Script::new(&kernel, model, &format!("{robot}_newton"));
        assert!(script.closes, "{robot}");
        let folder = folder("js");
        let files = script.write(&folder).unwrap();
        if script.test(&folder, &Cancel::default()).is_ok_and(|words| words.is_none()) {
            println!("not run: no node");
            return;
        }
        // from zero, as a page asks
        let zero: Vec<f64> =
            model.info().tree_q.iter().map(|q| f64::from(q.ends_with("/qw"))).collect();
        let guess = plan.given().slot(Field::QGuess).unwrap().range();
        let mut inputs = RandomInputs::new(model, &plan);
        let given: Vec<Vec<f64>> = (0..count)
            .map(|k| {
                // anywhere in the limits
                let mut input = inputs.input(FRESH + 4 * k);
                input[guess.clone()].copy_from_slice(&zero);
                input
            })
            .collect();
        let mut node = Command::new("node");
        node.arg(&files[1]);
        let found = answers(node, "given", &given, plan.want().len());
        let mut workspace = Workspace::for_plans(model, [&plan]);
        let mut exact = Workspace::for_plans(&compiled.exact, [&plan]);
        let mut output = vec![0.0; plan.want().len()];
        let mut reference = vec![Dd::from_f64(0.0); plan.want().len()];
        let mut both = 0;
        let mut left = 0;
        let mut worst: f64 = 0.0;
        for (input, (outcome, numbers)) in given.iter().zip(found) {
            let status = plan.run(model, &mut workspace, input, &mut output).status;
            if outcome == Outcome::NotAnswered {
                left += u64::from(status == Status::Ok);
                continue;
            }
            assert_eq!(status, Status::Ok, "{robot} {input:?}");
            both += 1;
            let off = deviation(&plan, &numbers, &output);
            worst = worst.max(off);
            if off > 1e-13 {
                let input: Vec<Dd> = input.iter().map(|x| Dd::from_f64(*x)).collect();
                let _ = plan.run(&compiled.exact, &mut exact, &input, &mut reference);
                let reference: Vec<f64> = reference.iter().map(|x| x.to_f64()).collect();
                let own = deviation(&plan, &output, &reference);
                assert!(off <= 4.0 * own, "{robot}: {off:e}, the plan {own:e} at {input:?}");
            }
        }
        println!("{robot}: {both} of {count} as the plan, worst {worst:.1e}; {left} left to it");
        assert!(both > 0 && left == 0);
    }
}

#[test]
fn sigma_min_in_javascript_is_that_of_the_plans() {
    let robots = match asked() {
        Some(_) => ROBOTS.into_iter().chain(OTHERS).collect(),
        None => vec!["lambda", "five_bar", "bricard"],
    };
    let count = asked().unwrap_or(64);
    for robot in robots {
        let model = model(robot);
        let want = Field::Q | Field::SigmaMin;
        let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
        let plan = Plan::new(&model, &query).unwrap();
        let (text, _) = sigma_min(&model, &plan, "sigma_min").unwrap();
        let mut inputs = RandomInputs::new(&model, &plan);
        let mut workspace = Workspace::for_plans(&model, [&plan]);
        let mut output = vec![0.0; plan.want().len()];
        let [q, sigma] = [Field::Q, Field::SigmaMin].map(|field| plan.want().slot(field).unwrap());
        let mut rows = Vec::new();
        for k in 0..count {
            let status = plan.run(&model, &mut workspace, &inputs.input(k), &mut output).status;
            if status == Status::Ok {
                rows.push(format!("[{:?}, {:e}]", &output[q.range()], output[sigma.offset]));
            }
        }
        let path = folder("js").join(format!("{robot}_sigma.js"));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let test = format!(
            "{text}\nconst rows = [{}];\nlet worst = 0;\nfor (const [q, expected] of rows) {{\n\
             const off = Math.abs(sigma_min(Float64Array.from(q)) - expected);\n\
             worst = off <= worst ? worst : off;\n}}\nconsole.log(worst);\n",
            rows.join(",\n")
        );
        std::fs::write(&path, test).unwrap();
        let Ok(ended) = Command::new("node").arg(&path).output() else {
            println!("not run: no node");
            return;
        };
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let worst: f64 = String::from_utf8_lossy(&ended.stdout).trim().parse().unwrap();
        println!("{robot}: {} states, {worst:.1e}", rows.len());
        // of scaled singular values, which are at most some units
        assert!(worst < 1e-13 && !rows.is_empty(), "{robot}: {worst:e}");
    }
}

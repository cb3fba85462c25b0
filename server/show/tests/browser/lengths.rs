//! Mechanisms whose lengths one edits, in node and in Chromium, against the plans of robots that
//! were compiled with these lengths.

use std::path::PathBuf;
use std::process::Command;

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_show::{MECHANISMS, Mechanism};
use serde_json::Value;

use crate::{SIZES, numbers, references, run_page};

/// q, u, G and G_u of the plan of a mechanism with these lengths, from its zero pose.
fn with_lengths(mechanism: &Mechanism, lengths: &[f64], y: &[f64]) -> Option<[Vec<f64>; 4]> {
    let model = mechanism.compile(lengths).ok()?.model;
    let want = [Field::Q, Field::U, Field::G, Field::GU];
    let given = FieldSet::of(&[Field::Y, Field::QGuess]);
    let query = Query::new(Request::Kinematics, given, FieldSet::of(&want));
    let plan = Plan::new(&model, &query).unwrap();
    let mut output = vec![0.0; plan.want().len()];
    let input = [y, &model.tree_zero()].concat();
    let mut workspace = Workspace::for_plans(&model, [&plan]);
    let status = plan.run(&model, &mut workspace, &input, &mut output).status;
    let field = |field| output[plan.want().slot(field).unwrap().range()].to_vec();
    (status == Status::Ok).then(|| want.map(field))
}

/// The largest deviation, by the size of each field.
fn deviation(found: &[Vec<f64>], expected: &[Vec<f64>]) -> f64 {
    let of = |(found, expected): (&Vec<f64>, &Vec<f64>)| {
        let size = expected.iter().fold(1e-300, |size: f64, x| size.max(x.abs()));
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs() / size);
        off.fold(0.0, f64::max)
    };
    found.iter().zip(expected).map(of).fold(0.0, f64::max)
}

#[test]
fn lengths_as_inputs_give_the_numbers_of_the_plans_with_them_in_node() {
    for mechanism in MECHANISMS {
        let text = mechanism.page().unwrap();
        let script = text.split("<script>").find(|part| part.contains("const pose = ")).unwrap();
        let script = script.split("</script>").next().unwrap();
        let lengths = mechanism.lengths();
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 11) as f64 / (1_u64 << 53) as f64
        };
        let n_y = mechanism.compile(&lengths).unwrap().model.info().independent.len();
        let states: Vec<[Vec<f64>; 2]> = (0..400)
            .map(|_| {
                let of = lengths.iter().map(|x| if *x == 0.0 { 0.02 } else { *x } * (0.5 + next()));
                [of.collect(), (0..n_y).map(|_| 1.4 * (2.0 * next() - 1.0)).collect()]
            })
            .collect();
        let zero = mechanism.compile(&lengths).unwrap().model.tree_zero();
        let ask = format!(
            "{script}\nconst states = {states:?};\nconst wanted = new Float64Array(pose.outputs);\n\
             const size = Object.values(pose.given).reduce((sum, of) => sum + of.rows, 0);\n\
             console.log(JSON.stringify(states.map(([lengths, y]) => {{\n\
             const given = new Float64Array(size);\n\
             for (const [name, of] of Object.entries({{ y, lengths, q_guess: {zero:?} }})) \
             given.set(of, pose.given[name].at);\n\
             if (pose.ask(given, wanted) === 2) return null;\n\
             return [\"q\", \"u\", \"G\", \"G_u\"].map((name) => {{ const {{ at, rows, columns }} = \
             pose.wanted[name]; return Array.from(wanted.subarray(at, at + rows * columns)); }});\n\
             }})));"
        );
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(mechanism.name);
        std::fs::write(&path, ask).unwrap();
        let Ok(ended) = Command::new("node").arg(&path).output() else {
            println!("not run: no node");
            return;
        };
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let answers: Value = serde_json::from_slice(&ended.stdout).unwrap();
        let [mut both, mut left] = [0; 2];
        let mut worst: f64 = 0.0;
        for ([lengths, y], found) in states.iter().zip(answers.as_array().unwrap()) {
            let expected = with_lengths(&mechanism, lengths, y);
            let (Some(found), Some(expected)) = (found.as_array(), expected.as_ref()) else {
                left += usize::from(expected.is_some() != found.is_array());
                continue;
            };
            let found: Vec<Vec<f64>> = found.iter().map(numbers).collect();
            both += 1;
            worst = worst.max(deviation(&found, expected));
        }
        println!(
            "{}: {both} states, worst {worst:.1e}, {left} with another status",
            mechanism.name
        );
        assert!(both > 200 && worst < 1e-12);
    }
}

#[test]
fn a_length_moves_the_mechanism_and_its_singular_poses() {
    let script = "
        const { name } = robot;
        const set = (id, value) => {
            const input = element(id);
            input.value = value;
            input.dispatchEvent(new Event('input'));
        };
        const before = structuredClone(view.worlds);
        survey();
        answer.before = element('singular').textContent;
        LENGTHS.forEach((length, k) => set(`lengths${k}`, length));
        set('sliders0', 0.3);
        survey();
        answer.moved = Math.max(...view.worlds.map((of, k) => distance(of, before[k])));
        answer.lengths = [...now.lengths];
        answer.y = [...now.y];
        answer.found = ['q', 'u', 'G', 'G_u'].map((field) => now.answer[field]);
        answer.shown = element('gamma').rows[robot.q.length].cells[1].textContent;
        answer.after = element('singular').textContent;
        answer.deviation = deviation;
        answer.painted = painted();
        answer.kind = view.kind;
        answer.wide = document.documentElement.scrollWidth - innerWidth;
        answer.labelled = [...document.querySelectorAll('input[type=range]')].every(
            (input) => input.labels.length === 1 && input.tabIndex === 0);
        // keys change a length too
        const slider = element('lengths0');
        slider.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight', cancelable: true }));
        answer.by_key = now.lengths[0];
        element('reset').click();
        answer.reset = [now.lengths, now.y];
    ";
    for (mechanism, set) in MECHANISMS.iter().zip([[0.14, 0.05], [0.03, 0.06]]) {
        let text = mechanism.page().unwrap();
        assert!(text.len() < 3_000_000 && references(&text) == 0, "{}", text.len());
        let script = script.replace("LENGTHS", &format!("{set:?}"));
        for (size, hash) in SIZES.into_iter().zip(["", "", "", "#lines"]) {
            let Some(answer) = run_page(mechanism.name, &text, &script, size, hash) else { return };
            println!("{} {size:?}: {answer}", mechanism.name);
            let lengths = numbers(&answer["lengths"]);
            assert_eq!(lengths[..2], set);
            let expected = with_lengths(mechanism, &lengths, &numbers(&answer["y"])).unwrap();
            let found: Vec<Vec<f64>> =
                answer["found"].as_array().unwrap().iter().map(numbers).collect();
            let off = deviation(&found, &expected);
            assert!(off < 1e-13, "{off:e}");
            let shown: f64 = answer["shown"].as_str().unwrap().parse().unwrap();
            assert!((shown - found[0].last().unwrap()).abs() < 1e-4);
            assert!(answer["deviation"]["worst"].as_f64().unwrap() < 1e-12);
            assert!(answer["moved"].as_f64().unwrap() > 0.01);
            assert_ne!(answer["before"], "");
            assert!(mechanism.name.starts_with("ankle") || answer["before"] != answer["after"]);
            // lines are thin on a large screen
            assert!(answer["painted"].as_f64().unwrap() > 100.0);
            assert!(answer["wide"].as_f64().unwrap() <= 0.0);
            assert_eq!(answer["labelled"], true);
            assert!(answer["by_key"].as_f64().unwrap() > set[0]);
            let reset = answer["reset"].as_array().unwrap();
            assert_eq!(numbers(&reset[0]), mechanism.lengths());
            assert!(numbers(&reset[1]).iter().all(|y| *y == 0.0));
        }
    }
}

//! Two small robots, with a compiler and with one that fails.
#![allow(clippy::unwrap_used, reason = "a test that fails panics")]

use sarrus_generate::Cancel;

use super::*;

#[test]
fn code_of_a_robot_is_measured_and_what_has_none_says_why() {
    let Some(compiler) = Compiler::found() else { return println!("not run: no C compiler") };
    let fails = Compiler::named("true", &Cancel::default()).unwrap();
    let amount = Amount { rounds: Duration::from_millis(50), of_peer: 0.001, ..FEW };
    for (compiler, coded) in [(compiler, true), (fails, false)] {
        let mut rows = Vec::new();
        let mut refused = Vec::new();
        for name in ["lambda", "wrist"] {
            let robot = Robot::load(Subject::Bundled(name), 4).unwrap();
            of_robot(&robot, &amount, &compiler, &mut rows, &mut refused).unwrap();
        }
        assert_eq!((rows.len(), refused.len()), (6, if coded { 0 } else { 6 }), "{refused:?}");
        assert!(refused.iter().all(|row| !row[2].is_empty()), "{refused:?}");
        for row in &rows {
            assert!(row.plan > 0.0 && row.error < 1e-12, "{:?}", row.cells());
            assert_eq!(row.code.is_some(), coded, "{:?}", row.cells());
            if let Some(code) = &row.code {
                assert!(code.operations > 0 && code.bare > 0.0, "{:?}", row.cells());
                assert!(
                    code.in_process > 0.0 && code.in_rows > 0.0 && code.alone > 0.0,
                    "{:?}",
                    row.cells()
                );
            }
        }
        assert_eq!(summary(&rows).contains("as fast as the plan"), coded);
    }
}

#[test]
fn a_peer_that_is_less_exact_does_not_count() {
    let robot = Robot::load(Subject::Bundled("lambda"), 1).unwrap();
    let mut references = References::new(&robot);
    let asked = Question::InverseDynamics;
    let mut case = {
        let model = &robot.variants[0].compiled.model;
        Case::new(&robot, model, Plan::new(model, &asked.query()).unwrap(), None)
    };
    case.answer(0).ok().unwrap();
    let run = |ns: f64, off: f64| Run {
        question: asked,
        name: "Pinocchio".into(),
        setting: String::new(),
        ns,
        answers: vec![case.planned.output.iter().map(|x| x * (1.0 + off)).collect()],
    };
    let runs = [run(10.0, 1e-6), run(30.0, 0.0), run(20.0, 1e-15)];
    let found = fastest(&mut references, (asked, Start::None), &runs, EQUAL);
    assert_eq!(found.unwrap(), Some(20.0));
}

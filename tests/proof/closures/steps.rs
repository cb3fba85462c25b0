//! Single loops without a closed form, closed by a fixed number of steps from a table, against
//! Newton's method on all of their rows and in straight-line code.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Compiled, Field, FieldSet, Model, Plan, Query, Request, Workspace};
use sarrus_generate::{Kernel, Outcome};
use sarrus_tests::cases::Case;
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{cross, unit};
use sarrus_tests::seed::Seeded;

use super::{Fields, X, Y_AXIS, Z, answers, compared, numerical, robots, share};

/// A loop of revolute joints at random places, whose cut is one too or a ball, with one, two or
/// three independent joints.
fn ring(seed: u64, straight: bool) -> Draft {
    let mut draft = Draft::new(seed, Kind::Numerical, straight);
    let [joints, free] = [[6, 1], [5, 2], [6, 3]][(seed % 3) as usize];
    let mut link = 0;
    let mut tree = Vec::new();
    for _ in 0..joints {
        let at = draft.seeded.vector(0.7);
        let axis = draft.seeded.direction();
        let (joint, moved) = draft.turn(link, at, axis);
        tree.push(joint);
        link = moved;
    }
    let at = draft.seeded.vector(0.7);
    let axis = draft.seeded.direction();
    let across = unit(cross(axis, draft.seeded.direction()));
    let angular = [across, cross(axis, across)];
    draft.cut(link, 0, at, if free == 1 { &angular } else { &[] }, &[X, Y_AXIS, Z]);
    let independent: Vec<usize> = (0..free).map(|k| tree[(k + seed as usize) % joints]).collect();
    let reach: Vec<(usize, f64)> = independent.iter().map(|joint| (*joint, 0.3)).collect();
    draft.roles(&reach, &independent);
    draft.shuffled()
}

fn plan(of: &Compiled) -> Plan {
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let want = FieldSet::of(&[Field::Q, Field::TauY]);
    Plan::new(&of.model, &Query::new(Request::InverseDynamics, given, want)).unwrap()
}

/// Whether it starts from a table in steps that code can take.
fn has_steps(of: &Compiled) -> bool {
    let parts = of.model.closures_at_zero().remove(0).parts;
    let numbers = plan(of).closed_numbers(&of.model);
    let is_seed = numbers.iter().any(|of| of.name == "seed");
    is_seed && parts.iter().all(|part| part.method == "newton")
}

#[test]
fn steps_from_a_table_close_loops_as_newtons_method_does() {
    let count = compared(240, ring, has_steps);
    assert!(count[0] > 60 && count[1] > 10_000 && 100 * count[3] < count[1], "{count:?}");
}

#[test]
fn code_takes_the_steps_to_the_bit() {
    let mut count = [0; 3];
    let drawn = (0..24).filter_map(|seed| {
        let draft = ring(seed, false);
        let form = Model::compile(&draft.description()).ok()?;
        has_steps(&form).then_some(form)
    });
    let bundled = ["bennett", "bricard"].map(|name| Case::bundled(name).compiled);
    assert!(bundled.iter().all(has_steps));
    for form in bundled.into_iter().chain(drawn) {
        // the trace itself compares bits on other states
        let plan = plan(&form);
        let kernel = Kernel::trace(&form.model, &plan).unwrap();
        count[0] += 1;
        let mut workspace = Workspace::new(&form.model);
        let mut seeded = Seeded::new(3);
        let n = form.model.sizes().n_vy;
        for _ in 0..100 {
            let input = seeded.numbers(3 * n, 0.2);
            let Some(closed) = plan.close(&form.model, &mut workspace, &input) else { continue };
            let mut output = vec![0.0; kernel.outputs()];
            count[1] += 1;
            count[2] += usize::from(kernel.evaluate(closed, &mut output) != Outcome::NotAnswered);
        }
    }
    println!("{count:?} mechanisms, states, states answered");
    assert!(count[0] > 8 && count[1] > 500 && 10 * count[2] > 9 * count[1], "{count:?}");
}

#[test]
fn overconstrained_loops_stand_where_newtons_method_has_them() {
    let mut worst = 0.0_f64;
    let mut count = 0;
    for (name, reach) in [("bennett", 3.0), ("bricard", 0.5)] {
        let Case { description, compiled, .. } = Case::bundled(name);
        let newton = numerical(&description);
        let (mut mine_of, _) = robots(&compiled);
        let (mut rows_of, mut exact_of) = robots(&newton);
        let mut seeded = Seeded::new(43);
        for k in 0..5000 {
            let y = seeded.numbers(1, reach);
            let yd = seeded.numbers(1, 1.0);
            let cast = |x: Option<(Fields<f64>, Fields<f64>)>| {
                x.map(|x| (x.0.map(Dd::from), x.1.map(Dd::from)))
            };
            let mine = cast(answers(&mut mine_of, &y, &yd));
            let rows = cast(answers(&mut rows_of, &y, &yd));
            assert_eq!(mine.is_some(), rows.is_some(), "{name} at {y:?}");
            let Some((mine, rows)) = mine.zip(rows) else { continue };
            let epsilon = 64.0 / 100.0 * f64::EPSILON;
            worst = worst.max(share(&mine, &rows, 2.0 * epsilon, 0.3));
            if k % 50 == 0 {
                let exact = answers(&mut exact_of, &y, &yd).expect("a pose of doubles");
                worst = worst.max(share(&mine, &exact, epsilon, 0.3));
            }
            assert!(worst <= 1.0, "{name} at {y:?}: {worst}");
            count += 1;
        }
    }
    println!("{count} states, {worst:.1e} of the bound");
    assert!(count > 8000, "{count}");
}

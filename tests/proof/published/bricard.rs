//! Bricard's mechanism (IFToMM A04).

use sarrus_tests::compare::assert_close;

use super::*;

#[test]
fn bricards_mechanism_moves_and_falls_as_published() {
    let compiled = bundled("bricard");
    let closure = &compiled.model.closures()[0];
    assert_eq!((closure.rows, closure.rank, compiled.model.sizes().n_vy), (5, 4, 1));
    let mut robot = Robot::new(compiled.model);
    let mut motion = Motion { q: vec![0.0; 5], ..Motion::default() };
    let p3 = [link(&robot, "rod3")];
    for (seconds, published) in [
        (0.5, [0.968283679107, -1.224625159436, 0.750146609438]),
        (1.0, [0.510501461187, -1.649167599395, 0.140123114553]),
    ] {
        for _ in 0..400 {
            motion.step(&mut robot, 0.5 / 400.0, |robot, y, yd, guess| {
                let given: [(Field, &[f64]); 4] =
                    [(Y, &[y]), (Yd, &[yd]), (TauU, &[0.0]), (QGuess, guess)];
                robot.ask(Request::ForwardDynamics, &given, &[Ydd]).ok().get(Ydd)[0]
            });
        }
        let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[FramePose]))
            .with_frames(&p3);
        let state = robot.ask_for(query, &[(Y, &[motion.y]), (QGuess, &motion.q)]).ok();
        // published with y upwards
        let [x, north, up] = [0, 1, 2].map(|i| state.get(FramePose)[i]);
        // published with twelve decimals
        assert_close(&format!("P3({seconds})"), &[x, up, -north], &published, 1.0, 1e-12);
    }
}

//! A change of independents during a simulation.

use sarrus_dynamics::description::{JointKind, Limits};
use sarrus_dynamics::{Field, Request, Status, Warnings};
use sarrus_simulation::{End, EventKind, Source, Space};

use super::*;

/// A crank of 0.1 m with a heavy wheel, a rod of 0.3 m and a slider; any of the joints may be
/// independent.
pub(super) fn slider_crank(kind: &str, independent: &str) -> Robot {
    let link = |name: &str, mass: f64, at: f64, inertia: f64| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"{at} 0 0\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"{inertia}\" ixy=\"0\" ixz=\"0\" iyy=\"{inertia}\" iyz=\"0\" \
             izz=\"{inertia}\"/></inertial></link>"
        )
    };
    let joint = |name: &str, kind: &str, parent: &str, child: &str, origin: &str, axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child \
             link=\"{child}\"/><origin {origin}/><axis xyz=\"{axis}\"/><limit lower=\"-9\" \
             upper=\"9\" effort=\"1\" velocity=\"9\"/></joint>"
        )
    };
    // the crank is vertical, the rod ends on the line of the slider
    let tilt = (0.1_f64 / 0.3).asin();
    let reach = 0.3 * tilt.cos();
    let urdf = [
        "<robot name=\"slider_crank\"><link name=\"base\"/>".to_owned(),
        link("crank", 2.0, 0.0, 0.02),
        link("rod", 0.3, 0.15, 0.002),
        link("slider", 0.5, 0.0, 0.001),
        joint(
            "turn",
            "continuous",
            "base",
            "crank",
            &format!("xyz=\"0 0 0\" rpy=\"0 {} 0\"", -std::f64::consts::FRAC_PI_2),
            "0 1 0",
        ),
        joint(
            "pin",
            "continuous",
            "crank",
            "rod",
            &format!("xyz=\"0.1 0 0\" rpy=\"0 {} 0\"", std::f64::consts::FRAC_PI_2 + tilt),
            "0 1 0",
        ),
        joint("slide", "prismatic", "base", "slider", &format!("xyz=\"{reach} 0 0\""), "1 0 0"),
        "</robot>".to_owned(),
    ];
    let submechanisms = format!(
        "submechanisms:\n- type: {kind}\n  contextual_name: crank\n  jointnames_spanningtree: \
         [turn, pin, slide]\n  jointnames_independent: [{independent}]\n  jointnames_active: \
         [turn]\n  loop_constraints:\n  - cut_joint: eye\n    predecessor_body: rod\n    \
         successor_body: slider\n    predecessor_placement: {{xyz: [0.3, 0, 0]}}\n    \
         successor_placement: {{xyz: [0, 0, 0]}}\n    cut_joint_type: planar_revolute\n    axis: \
         [0, 1, 0]\n"
    );
    Robot::text(&urdf.concat(), Some(&submechanisms))
}

#[test]
fn a_slider_crank_driven_by_its_slider_goes_round_by_another_independent() {
    let right = slider_crank("NUMERICAL", "turn");
    let wrong = slider_crank("NUMERICAL", "slide");
    let reference = right.run(&from(&[0.0], &[6.0]), &adaptive(Method::Dop853, 1e-11, 3.0));
    let turns = arrived(&reference).y[0] / (2.0 * std::f64::consts::PI);
    assert!(turns > 2.0, "{turns} turns only");
    // ẋ of the slider at ẏ of the crank: from the same state of the tree
    let start =
        Start::Tree { q: reference.samples[0].q.clone(), qd: reference.samples[0].qd.clone() };
    for settings in [
        adaptive(Method::Dop853, 1e-11, 3.0),
        adaptive(Method::Radau5, 1e-10, 3.0),
        fixed(Method::RungeKutta, 2.5e-4, 3.0),
    ] {
        let run = wrong.run(&start, &settings);
        let end = arrived(&run);
        println!("{} {:?} {:?}", settings.method.name(), run.counts, run.events);
        assert!(
            run.events.iter().any(|event| matches!(event.kind, EventKind::Switched { .. })),
            "{:?}",
            run.events
        );
        assert!(
            run.independents == ["turn"] || run.independents == ["pin"],
            "{:?}",
            run.independents
        );
        let gap = end
            .q
            .iter()
            .zip(&arrived(&reference).q)
            .fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()));
        assert!(gap < 1e-7, "{} ends {gap:e} away", settings.method.name());
        // y keeps its declared meaning
        assert_eq!(end.y, [end.q[2]]);
    }
}

#[test]
fn without_switching_it_ends_at_the_dead_centre_and_says_why() {
    let robot = slider_crank("NUMERICAL", "slide");
    let reference = slider_crank("NUMERICAL", "turn")
        .run(&from(&[0.0], &[6.0]), &adaptive(Method::Dop853, 1e-9, 0.1));
    let start =
        Start::Tree { q: reference.samples[0].q.clone(), qd: reference.samples[0].qd.clone() };
    for settings in [
        adaptive(Method::Dop853, 1e-9, 3.0),
        adaptive(Method::Radau5, 1e-9, 3.0),
        fixed(Method::RungeKutta, 1e-3, 3.0),
    ] {
        let run = robot.run(&start, &Settings { switching: false, every: None, ..settings });
        println!("{} {:?} at {} {:?}", settings.method.name(), run.end, run.time, run.counts);
        let said = [
            Status::Unreachable,
            Status::SingularIndependents,
            Status::BranchChanged,
            Status::NotConverged,
        ];
        assert!(
            matches!(run.end, End::Failed(status) if said.contains(&status))
                || run.end == End::StepTooShort,
            "{:?}",
            run.end
        );
        // crank and rod are aligned at a dead centre: x = 0.2 or 0.4
        let end = run.last().unwrap();
        let at = 0.3 * (0.1_f64 / 0.3).asin().cos() + end.q[2];
        assert!((at - 0.4).abs().min((at - 0.2).abs()) < 1e-2, "ends at {at}");
        // the motion never reverses
        assert!(run.samples.iter().all(|sample| sample.qd[0] > 3.0), "{:?}", run.last());
        assert!(
            run.samples.len() > 10
                && run.samples.iter().all(|sample| sample.q.iter().all(|x| x.is_finite()))
        );
    }
}

#[test]
fn closed_forms_are_left_for_others_where_they_have_to_be() {
    let right = slider_crank("NUMERICAL", "turn");
    let wrong = slider_crank("SLIDERCRANK", "slide");
    let reference = right.run(&from(&[0.0], &[6.0]), &adaptive(Method::Dop853, 1e-11, 2.0));
    let start =
        Start::Tree { q: reference.samples[0].q.clone(), qd: reference.samples[0].qd.clone() };
    let run = wrong.run(&start, &adaptive(Method::Dop853, 1e-10, 2.0));
    let gap = arrived(&run)
        .q
        .iter()
        .zip(&arrived(&reference).q)
        .fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()));
    println!("{:?}", run.events);
    assert!(gap < 1e-7, "ends {gap:e} away");
}

#[test]
fn an_input_on_the_declared_independents_stays_with_its_joint() {
    // a force on the slider has the same effect with any independent
    let mut wrong = slider_crank("NUMERICAL", "slide");
    wrong.inputs.push(Input { space: Space::Independent, source: Source::Constant(vec![0.5]) });
    let right = slider_crank("NUMERICAL", "turn");
    let begin = right.run(&from(&[0.0], &[6.0]), &adaptive(Method::Dop853, 1e-9, 0.01));
    let start = Start::Tree { q: begin.samples[0].q.clone(), qd: begin.samples[0].qd.clone() };
    let run = wrong.run(&start, &adaptive(Method::Dop853, 1e-10, 2.0));
    let end = arrived(&run);
    assert_ne!(run.independents, ["slide"]);
    // work of a constant force
    let expected = 0.5 * (end.q[2] - run.samples[0].q[2]);
    assert!((end.work - expected).abs() < 1e-8, "{} instead of {expected}", end.work);
    assert!(run.drift() < 1e-7, "{:e}", run.drift());
}

#[test]
fn a_spring_on_a_dependent_joint_winds_up_alike_in_a_closed_form_and_in_newtons_method() {
    let wound = |kind: &str| {
        let mut robot = slider_crank(kind, "turn");
        let pin = robot.loaded.description.joints.iter_mut().find(|joint| joint.name == "pin");
        let pin = pin.unwrap();
        pin.terms.stiffness = 0.05;
        // a limit that no angle exceeds
        pin.kind = JointKind::Revolute;
        let [velocity, effort] = [f64::INFINITY; 2];
        pin.limits = Some(Limits { lower: -4.0, upper: 4.0, velocity, effort });
        let description = &robot.loaded.description;
        robot.loaded.compiled = sarrus_dynamics::Model::compile(description).unwrap();
        let run = robot.run(&from(&[0.0], &[6.0]), &adaptive(Method::Dop853, 1e-10, 3.0));
        assert!(run.drift() < 1e-7, "{kind}: energy drifts by {:e}", run.drift());
        let beyond = run.exceeded(robot.loaded.compiled.model.info());
        assert!(beyond.iter().any(|limit| limit.name == "pin"), "{kind}: {beyond:?}");
        let mut asked = sarrus_tests::run::Robot::new(robot.loaded.compiled.model.clone());
        for (turn, warnings) in [(3.0, Warnings::NONE), (5.0, Warnings::LIMITS_EXCEEDED)] {
            let answer = asked.ask(Request::Kinematics, &[(Field::Y, &[turn])], &[Field::Q]).ok();
            assert_eq!(answer.answer.warnings, warnings, "{kind} at {turn}");
        }
        arrived(&run).q.clone()
    };
    let [form, newton] = ["SLIDERCRANK", "NUMERICAL"].map(wound);
    let gap = form.iter().zip(&newton).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    assert!(gap < 1e-7, "{form:?} and {newton:?}");
    assert!(form[1].abs() > std::f64::consts::PI, "{form:?}");
}

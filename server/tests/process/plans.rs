//! Plans of clients: each belongs to one robot and comes free without holders; its number never
//! stands for another plan.

use std::time::Instant;

use sarrus_client::{
    Error, Field, FieldSet, Options, PlanId, Query, Request, Robot, Source, Status, Transport,
    Warnings,
};
use sarrus_proto::control::{Call, Grant};
use sarrus_proto::message::{MAX_PLANS, MAX_PLANS_OF_PROCESS, PlanNumber};

use sarrus_torture::patience::LIMIT;

use crate::support::{Asker, ROBOT, Sandbox, options, wait_until};

/// More queries than a server holds, each another one.
pub(crate) fn distinct(number: usize) -> Query {
    const WANT: [Field; 13] = [
        Field::Y,
        Field::Yd,
        Field::Ydd,
        Field::Q,
        Field::Qd,
        Field::Qdd,
        Field::U,
        Field::Ud,
        Field::Udd,
        Field::Residual,
        Field::Iterations,
        Field::SigmaMin,
        Field::Branch,
    ];
    assert!(number < 1 << WANT.len());
    let want = WANT.into_iter().enumerate().filter(|(bit, _)| number >> bit & 1 == 1);
    let want = want.map(|(_, field)| field).collect::<FieldSet>();
    Query::new(Request::Kinematics, FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]), want)
}

fn local() -> Robot {
    Robot::load(&Source::Bundled(ROBOT.into()), &Options::default()).unwrap()
}

/// The status of a plan's answer.
fn status(robot: &mut Robot, plan: PlanId) -> Status {
    let (n_in, n_out) =
        robot.plan(plan).map(|plan| (plan.given().len(), plan.want().len())).unwrap();
    robot.ask(plan, &vec![0.0; n_in], &mut vec![0.0; n_out]).unwrap().status
}

/// Waits until the server's clients hold so many plans.
fn wait_for_plans(robot: &Robot, plans: u64) {
    wait_until(&format!("{plans} plans"), || robot.statistics().unwrap().plans == plans);
}

#[test]
fn a_plan_of_another_robot_is_refused_though_its_sizes_agree() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("twins", &[]);
    let mut robots = [local(), local()]
        .into_iter()
        .chain(
            [Transport::Lane, Transport::Service].map(|way| sandbox.connect("twins", way).unwrap()),
        )
        .collect::<Vec<_>>();
    let plans = robots.iter_mut().map(|robot| robot.prepare(&distinct(1)).unwrap());
    let plans = plans.collect::<Vec<_>>();
    for (i, robot) in robots.iter_mut().enumerate() {
        for (j, plan) in plans.iter().enumerate() {
            if i == j {
                assert_eq!(status(robot, *plan), Status::Ok);
                continue;
            }
            let mut output = [1.0; 3];
            let error = robot.ask(*plan, &[0.0; 3], &mut output).unwrap_err();
            assert!(matches!(error, Error::UnknownPlan), "{error}");
            assert!(error.to_string().contains("another robot"), "{error}");
            assert!(output.iter().all(|number| number.is_nan()));
            assert!(robot.plan(*plan).is_none());
            assert!(matches!(robot.release(*plan), Err(Error::UnknownPlan)));
        }
    }
}

#[test]
fn a_released_plan_is_an_error_until_it_is_prepared_again() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("again", &[]);
    for mut robot in [local(), sandbox.connect("again", Transport::Lane).unwrap()] {
        let [first, other] = [1, 2].map(|number| robot.prepare(&distinct(number)).unwrap());
        // equal queries share one plan, which is held twice then
        assert_eq!(robot.prepare(&distinct(1)).unwrap(), first);
        robot.release(first).unwrap();
        assert_eq!(status(&mut robot, first), Status::Ok);
        robot.release(first).unwrap();
        assert!(matches!(robot.ask(first, &[], &mut []), Err(Error::ReleasedPlan)));
        assert!(matches!(robot.release(first), Err(Error::ReleasedPlan)));
        // its place is another plan's now, its number is not
        let next = robot.prepare(&distinct(3)).unwrap();
        assert!(matches!(robot.ask(first, &[], &mut []), Err(Error::ReleasedPlan)));
        assert_eq!([next, other].map(|plan| status(&mut robot, plan)), [Status::Ok; 2]);
    }
}

#[test]
fn plans_that_are_released_make_room_for_thousands() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("many", &[]);
    let mut other = Asker::new(sandbox.connect("many", Transport::Service).unwrap());
    other.ask().unwrap().ok().unwrap();
    let bits = other.bits();
    let mut robot = sandbox.connect("many", Transport::Lane).unwrap();
    for number in 0..5000 {
        let plan = robot.prepare(&distinct(number)).unwrap();
        if number % 100 == 0 {
            assert_eq!(status(&mut robot, plan), Status::Ok);
            other.ask().unwrap().ok().unwrap();
            assert_eq!(other.bits(), bits);
        }
        robot.release(plan).unwrap();
    }
    wait_for_plans(&robot, 1);
    other.ask().unwrap().ok().unwrap();
    assert_eq!(other.bits(), bits);
    assert!(server.stop().success());
}

#[test]
fn plans_of_clients_that_leave_or_are_killed_come_free() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("heirs", &[]);
    let mut asker = Asker::new(sandbox.connect("heirs", Transport::Lane).unwrap());
    asker.ask().unwrap().ok().unwrap();
    let bits = asker.bits();

    // a full table is an error with a remedy
    let mut greedy = sandbox.connect("heirs", Transport::Service).unwrap();
    let mut plans = Vec::new();
    let error = loop {
        match greedy.prepare(&distinct(plans.len())) {
            Ok(plan) => plans.push(plan),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, Error::TooManyPlans { limit: MAX_PLANS, .. }), "{error}");
    let holder = format!("process {} holds {MAX_PLANS_OF_PROCESS};", std::process::id());
    assert!(error.to_string().contains(&holder), "{error}");
    // one of them is also the other client's
    assert_eq!(plans.len(), MAX_PLANS_OF_PROCESS);
    wait_for_plans(&asker.robot, MAX_PLANS_OF_PROCESS as u64);
    assert_eq!(status(&mut greedy, plans[700]), Status::Ok);
    // the others stay for other processes
    let other = sandbox.client_with("heirs", Transport::Lane, Some(4000));
    wait_for_plans(&asker.robot, MAX_PLANS_OF_PROCESS as u64 + 1);
    other.kill();
    wait_for_plans(&asker.robot, MAX_PLANS_OF_PROCESS as u64);

    // a client that leaves makes room at once
    drop(greedy);
    let mut next = sandbox.connect("heirs", Transport::Lane).unwrap();
    let plan = next.prepare(&distinct(2000)).unwrap();
    assert_eq!(status(&mut next, plan), Status::Ok);
    wait_for_plans(&asker.robot, 2);

    // and so does a killed one
    for transport in [Transport::Lane, Transport::Service] {
        let client = sandbox.client_with("heirs", transport, Some(3000));
        wait_for_plans(&asker.robot, 3);
        client.kill();
        wait_for_plans(&asker.robot, 2);
    }
    asker.ask().unwrap().ok().unwrap();
    assert_eq!(asker.bits(), bits);
}

#[test]
fn the_number_of_a_released_plan_is_never_another_plans() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("stale", &[]);
    let liar = sandbox.raw("stale");
    let (_node, mut client) = liar.take_service().unwrap();
    let release = |plan| match liar.call(Call::Release { plan }) {
        Ok(Grant::Released { had }) => had,
        other => panic!("{other:?}"),
    };
    let mut ask = |plan: PlanNumber| {
        client.cancel();
        assert!(client.send(&liar.head(plan.0, 1), &[0.0; 256]));
        let start = Instant::now();
        loop {
            if let Some((answer, _)) = client.poll().unwrap() {
                return Status::from_code(answer.status).unwrap();
            }
            assert!(start.elapsed() < LIMIT);
        }
    };

    let mut seen = Vec::new();
    // more than there are places
    for number in 0..MAX_PLANS + 100 {
        let registered = PlanNumber(liar.plan(&distinct(number)).unwrap().0);
        assert_eq!(ask(registered), Status::Ok);
        assert!(!seen.contains(&registered), "{registered:?} twice");
        seen.push(registered);
        assert_eq!((release(registered), release(registered)), (true, false));
    }
    // plans of other clients cannot be released
    let mut other = sandbox.connect("stale", Transport::Lane).unwrap();
    let held = other.prepare(&distinct(1)).unwrap();
    let start = Instant::now();
    for stale in [seen[0], seen[1], seen[MAX_PLANS], PlanNumber(u32::MAX)] {
        assert!(!release(stale));
        // the server releases it when it handles its orders
        while ask(stale) == Status::Ok {
            assert!(start.elapsed() < LIMIT, "{stale:?} still answers");
        }
        assert_eq!(ask(stale), Status::UnknownRequest);
    }
    assert_eq!(crate::plans::status(&mut other, held), Status::Ok);
}

#[test]
fn a_new_server_of_the_same_model_knows_the_plans_that_are_held() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("heir", &[]);
    let mut robot = sandbox.connect_with("heir", options()).unwrap();
    let plans = [1, 2, 3].map(|number| robot.prepare(&distinct(number)).unwrap());
    robot.release(plans[1]).unwrap();
    server.kill();
    // released without a server
    robot.release(plans[0]).unwrap();
    let _server = sandbox.serve("heir", &[]);
    assert_eq!(status(&mut robot, plans[2]), Status::Ok);
    wait_for_plans(&robot, 1);
    for released in [plans[0], plans[1]] {
        assert!(matches!(robot.ask(released, &[], &mut []), Err(Error::ReleasedPlan)));
    }
}

#[test]
fn all_unknown_names_of_a_query_are_reported_at_once() {
    let mut robot = local();
    let link = robot.model().links[3].clone();
    let near = format!("{link}_");
    let query = robot
        .query(Request::InverseDynamics)
        .given(["y", "yd", "yddd"])
        .want([Field::TauU.name(), "nonsense"])
        .frames([near.as_str()])
        .wrenches([link.as_str(), "no such thing at all"]);
    let error = query.prepare().unwrap_err();
    let Error::UnknownNames(names) = &error else { panic!("{error}") };
    let found = names.iter().map(|name| (name.name.as_str(), name.nearest.as_deref()));
    assert_eq!(
        found.collect::<Vec<_>>(),
        [
            ("yddd", Some("ydd")),
            ("nonsense", None),
            (near.as_str(), Some(link.as_str())),
            ("no such thing at all", None)
        ]
    );
    assert_eq!(error.to_string().lines().count(), 4);
    // fields by type and by name are the same query
    let by_name = robot.query(Request::InverseDynamics).given(["y", "yd"]).want(["tau_u"]);
    let by_name = by_name.prepare().unwrap();
    let typed = robot.query(Request::InverseDynamics).given((Field::Y | Field::Yd).iter());
    assert_eq!(typed.want([Field::TauU]).prepare().unwrap(), by_name);
}

#[test]
fn a_tolerance_of_a_query_decides_what_is_a_projection() {
    let mut robot = local();
    let n_y = robot.model().independent_q.len();
    let n_q = robot.model().tree_q.len();
    let pose = robot.query(Request::Kinematics).given(["y"]).want(["q"]).prepare().unwrap();
    let mut q = vec![0.0; n_q];
    robot.ask(pose, &vec![0.1; n_y], &mut q).unwrap().ok().unwrap();
    // measured coordinates that close no loop
    q.iter_mut().for_each(|x| *x += 1e-3 * x.sin());
    let mut y = vec![0.0; n_y];
    for (tolerance, is_projected) in [(0.0, true), (1.0, false)] {
        let query = robot.query(Request::Kinematics).given(["q"]).want(["y"]);
        let query = query.loop_tolerance(1.0).projection_tolerance(tolerance);
        let plan = query.prepare().unwrap();
        let answer = robot.ask(plan, &q, &mut y).unwrap();
        assert_eq!(answer.status, Status::Ok);
        assert_eq!(answer.warnings.contains(Warnings::INPUT_PROJECTED), is_projected);
    }
}

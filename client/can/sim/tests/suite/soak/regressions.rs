//! Runs of the soak that failed once, each with its cause, and the poses that its generator draws.

use super::*;

#[test]
fn what_failed_once_fails_no_more() {
    let drives = all_drives();
    let mut tally = Tally::default();
    for seed in [
        605_544, // into a limit: a stop by a weak damper
        606_651, // the strokes of its own loops seen as a velocity
        606_026, // a brake that closed at a current of zero
        601_602, 607_564, 608_920, // late answers of a motor that moves
        603_751, // blocked, with a soft spring that is not far behind for a while
        607_376, // a spring too soft for its load
        608_776, // a controller that swings
        603_701, // a pose that is near to a singular one
        813_226, // a pose of measurements farther apart than the cycles
        808_851, // the strokes of other motors' own loops seen as a velocity
        900_936, // blocked, and behind by less than what counts for certain
        901_251, // a limit passed in a fall before the efforts of arming have grown
        932_076, // behind its springs on the way to its rest
        906_696, // efforts of quick set-points in measurements that came late
        801_759, 812_592, // lost frames delay the set-up, and with it the reason
    ] {
        tally.run(seed, &drives);
    }
    assert!(tally.false_alarms.is_empty() && tally.unfound.is_empty());
}

#[test]
fn no_pose_of_a_box_is_near_to_a_singular_one() {
    let drives = all_drives();
    let mut seen = BTreeMap::new();
    for seed in (1..2000).step_by(ROBOTS as usize) {
        let mut run = Run::new(seed, &drives).expect("a run that is armed");
        let Body::Robot { half, .. } = &run.body else { panic!("{}", run.name) };
        let kind = run.name.split(' ').next().unwrap_or_default().to_owned();
        // a corner, a tenth outside, slowly
        let corner = seen.entry(kind).or_insert(0);
        if *corner == 1 << half.len().min(3) {
            continue;
        }
        let side = |i: usize| if *corner >> i & 1 == 0 { LEFT } else { -LEFT };
        run.way = half.iter().enumerate().map(|(i, half)| side(i) * half).collect();
        *corner += 1;
        run.next.seconds = 10.0;
        run.rests = true;
        let found = run.until(10.0);
        assert!(found != Some(Reason::NearSingular), "{} to {:?}", run.name, run.way);
    }
    assert_eq!(seen.len(), 9, "{seen:?}");
}

#[test]
fn parts_of_answers_whose_first_one_was_lost_are_no_lateness() {
    // a CiA 402 drive at 1000 Hz with 1.7 % loss and 2.3 ms of jitter
    let mut run = Run::new(311_550, &all_drives()).expect("a run that is armed");
    assert!(run.name == "cia402 torque" && run.world.period_ns == MS, "{}", run.name);
    assert_eq!(run.until(20.0), None);
}

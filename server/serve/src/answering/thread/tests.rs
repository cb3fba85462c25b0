//! The answering thread step by step: the order of answers, counted in tiles.

use std::os::fd::OwnedFd;

use rtrb::RingBuffer;
use sarrus_dynamics::scalar::LANES;
use sarrus_dynamics::{CUT_SHORT, Model, Plan};
use sarrus_models::{Options, Source, load};
use sarrus_proto::batch::{BatchHead, BatchShape, ClaimedBatch, MAX_BATCH_ROWS, ServedBatch};
use sarrus_proto::board::{ClaimedLane, class_of};
use sarrus_proto::message::{PlanNumber, store_numbers};
use sarrus_proto::run::{Link, Run};
use sarrus_proto::{Domain, Field, FieldSet, Node, PROTOCOL_VERSION, Query, Request, ServerName};

use super::*;
use crate::answering::aside::Aside;
use crate::answering::engine::{MAX_PLAN_ORDERS, PlanOrder, ServedPlan};

/// The number of the served plan.
const NUMBER: PlanNumber = PlanNumber(5);
const ROWS: usize = MAX_BATCH_ROWS;

/// An answering thread that sweeps on demand.
struct Stepped {
    hot: AnsweringThread,
    plan: Plan,
    fingerprint: u64,
    plan_orders: Producer<PlanOrder>,
    orders: Producer<Order>,
    retired: Consumer<Retired>,
}

/// A bundled robot whose loops are closed from all their rows, which takes longest.
fn with_all_rows(robot: &str) -> Model<f64> {
    let mut robot = load(&Source::Bundled(robot.into()), &Options::default()).unwrap().description;
    robot.submechanisms.iter_mut().for_each(|of| of.closed_forms = false);
    Model::compile(&robot).unwrap().model
}

impl Stepped {
    fn new() -> Stepped {
        let motion = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
        let query = Query::new(Request::InverseDynamics, motion, FieldSet::of(&[Field::TauU]));
        Stepped::of("rh5v2_upper_body", query)
    }

    fn of(robot: &str, query: Query) -> Stepped {
        let model = with_all_rows(robot);
        let plan = Plan::new(&model, &query).unwrap();
        let fingerprint = model.fingerprint();
        let (mut plan_orders, plan_orders_out) = RingBuffer::new(MAX_PLAN_ORDERS);
        let (retired_plans, _) = RingBuffer::new(8);
        let served = ServedPlan {
            number: NUMBER,
            plan: Arc::new(plan.clone()),
            kernel: None,
            checks: false,
        };
        assert!(plan_orders.push(PlanOrder::Serve(Box::new(served))).is_ok());
        let (orders_in, orders) = RingBuffer::new(16);
        let (retired_in, retired) = RingBuffer::new(16);
        let hot = AnsweringThread {
            engine: Engine::new(Arc::new(model), plan_orders_out, retired_plans),
            ends: Vec::with_capacity(16),
            next: 0,
            costly: vec![false; 8].into(),
            last_beat: 0,
            beat: 0,
            awaits: false,
            orders,
            retired: retired_in,
            heartbeat: HeartbeatWriter::new().unwrap(),
            shared: Arc::new(Shared {
                counters: Counters::new(8),
                stopping: AtomicBool::new(false),
            }),
            clock: Clock::new(),
            wait: Wait::Busy,
        };
        Stepped { hot, plan, fingerprint, plan_orders, orders: orders_in, retired }
    }

    /// The client's side of a lane that is polled from now on; it ends with the link.
    fn lane(&mut self, domain: &Domain, run: &Run, place: usize) -> (ClaimedLane, Vec<Node>, Link) {
        let (number, link) = run.new_link().unwrap();
        let classes = [self.plan.given().len(), self.plan.want().len()];
        let classes = classes.map(|n| class_of(n).unwrap());
        let node = link.node().unwrap();
        let lane = ServedLane::create(&node, classes).unwrap();
        assert!(
            self.orders
                .push(Order::Serve { place, end: End::Lane(lane, LastRequest::default()) })
                .is_ok()
        );
        self.hot.handle_orders();
        let other = Link::new(domain, run.instance(), number).unwrap().node().unwrap();
        let lane = ClaimedLane::claim(&other, classes).unwrap();
        (lane, vec![node, other], link)
    }

    /// The client's side of an area, which is polled from now on.
    fn batches(&mut self, place: usize) -> ClaimedBatch {
        let (area, memory): (ServedBatch, OwnedFd) = ServedBatch::create().unwrap();
        let end = End::Batches(Batches::new(area, Client::Service));
        assert!(self.orders.push(Order::Serve { place, end }).is_ok());
        self.hot.handle_orders();
        ClaimedBatch::open(&memory).unwrap()
    }

    /// Requests a batch of states near zero.
    fn ask(&self, area: &ClaimedBatch, sequence: u64, rows: usize) {
        let n_in = self.plan.given().len();
        let n_out = self.plan.want().len();
        let shape = BatchShape::new(rows as u64, n_in, n_out).unwrap();
        let input: Vec<f64> = (0..rows * n_in).map(|k| 1e-3 * (k % 101) as f64).collect();
        area.send(&self.head(sequence, rows), &shape, &input);
    }

    fn head(&self, sequence: u64, rows: usize) -> BatchHead {
        let fingerprint = self.fingerprint;
        let rows = rows as u64;
        BatchHead { version: PROTOCOL_VERSION, plan: NUMBER.0, fingerprint, sequence, rows }
    }

    fn answered(&self, status: Status) -> u64 {
        self.hot.shared.counters.counts().statuses[status as usize]
    }
}

#[test]
fn a_lane_waits_for_one_tile_at_most_and_batches_take_turns() {
    let root = std::env::temp_dir().join(format!("sarrus-turns-{}", std::process::id()));
    let domain = Domain::at(&root).unwrap();
    let run = Run::start(&domain, &ServerName::new("turns").unwrap()).unwrap();
    let mut stepped = Stepped::new();
    let (mut lane, nodes, link) = stepped.lane(&domain, &run, 0);
    let y = vec![0.1; stepped.plan.given().len()];

    let areas = [1, 2, 3].map(|place| stepped.batches(place));
    areas.iter().for_each(|area| stepped.ask(area, 1, ROWS));
    let mut sequence = 0;
    while areas.iter().any(|area| area.answer(1).is_none()) {
        // whenever the lane asks, its answer precedes the next whole tile
        let done = areas.each_ref().map(ClaimedBatch::done);
        sequence += 1;
        request(&stepped, &mut lane, sequence, &y);
        stepped.hot.sweep(false);
        let (answer, _) = lane.inbox.poll().unwrap();
        assert_eq!((answer.sequence, answer.status), (sequence, Status::Ok as u32));
        let now = areas.each_ref().map(ClaimedBatch::done);
        let rows = |done: [u64; 3]| done.iter().sum::<u64>();
        assert_eq!(rows(now) - rows(done), stepped.plan.abreast() as u64);
        // no client is ahead by more than the tile of this turn
        let [least, most] = [now.iter().min(), now.iter().max()].map(|x| *x.unwrap());
        assert!(most - least <= stepped.plan.abreast() as u64, "{now:?}");
    }
    assert_eq!(sequence as usize, 3 * ROWS / stepped.plan.abreast());
    let counts = stepped.hot.shared.counters.counts();
    assert_eq!((counts.lane_requests, counts.batch_states), (sequence, 3 * ROWS as u64));
    assert_eq!(stepped.answered(Status::Ok), sequence + 3 * ROWS as u64);
    drop((lane, stepped, nodes));
    link.remove();
    drop(run);
    domain.tidy();
}

#[test]
fn a_batch_that_is_asked_over_another_is_overloaded_and_the_next_is_answered() {
    let mut stepped = Stepped::new();
    let area = stepped.batches(0);
    stepped.ask(&area, 1, ROWS);
    assert_eq!(stepped.hot.sweep(false), 1);
    stepped.ask(&area, 2, ROWS);
    assert_eq!(stepped.hot.sweep(false), 1);
    assert_eq!((area.answer(1), area.answer(2)), (None, Some(Status::Overloaded as u32)));
    assert_eq!(stepped.hot.sweep(false), 0, "neither goes on");

    stepped.ask(&area, 3, LANES + 1);
    let mut turns = 0;
    while area.answer(3).is_none() {
        turns += stepped.hot.sweep(false);
    }
    assert_eq!((turns, area.answer(3)), ((LANES + 1).div_ceil(stepped.plan.abreast()), Some(0)));
    assert_eq!(stepped.answered(Status::Overloaded), 1);
}

#[test]
fn a_batch_ends_where_its_plan_or_the_server_does() {
    let mut stepped = Stepped::new();
    let [first, second] = [0, 1].map(|place| stepped.batches(place));
    stepped.ask(&first, 1, ROWS);
    assert_eq!(stepped.hot.sweep(false), 1);
    assert!(stepped.plan_orders.push(PlanOrder::Retire(NUMBER)).is_ok());
    stepped.hot.handle_orders();
    assert_eq!(stepped.hot.sweep(false), 1);
    assert_eq!(first.answer(1), Some(Status::UnknownRequest as u32));

    for area in [&first, &second] {
        stepped.ask(area, 2, 1);
    }
    assert_eq!((stepped.hot.sweep(true), stepped.hot.sweep(true)), (1, 1));
    for area in [&first, &second] {
        assert_eq!(area.answer(2), Some(Status::ShuttingDown as u32));
    }
}

#[test]
fn an_area_goes_back_with_the_end_beside_it() {
    let mut stepped = Stepped::new();
    let _areas = [7, 2].map(|place| stepped.batches(place));
    assert!(stepped.orders.push(Order::Serve { place: 7, end: End::Broken }).is_ok());
    assert!(stepped.orders.push(Order::Retire { place: 7 }).is_ok());
    stepped.hot.handle_orders();
    let back: Vec<usize> = std::iter::from_fn(|| stepped.retired.pop().ok()).map(|x| x.0).collect();
    assert_eq!((back, stepped.hot.ends.len()), (vec![7, 7], 1));
}

#[test]
fn a_plan_that_panics_over_a_tile_ends_its_client_alone() {
    let mut stepped = Stepped::new();
    let [panics, other] = [0, 1].map(|place| stepped.batches(place));
    let tile = stepped.plan.abreast();
    let Some((_, End::Batches(batches))) = stepped.hot.ends.first_mut() else { panic!("no area") };
    batches.panics_at = Some(tile);
    stepped.ask(&panics, 1, ROWS);
    stepped.ask(&other, 1, 2 * tile);
    let turns: usize = (0..4).map(|_| stepped.hot.sweep(false)).sum();
    assert_eq!((turns, other.answer(1)), (4, Some(Status::Ok as u32)));
    assert_eq!((panics.answer(1), panics.done()), (None, tile as u64));
    // its place is returned like that of a client that has broken its end
    let (place, end) = stepped.retired.pop().unwrap();
    assert!(place == 0 && matches!(end, End::Broken));
    assert_eq!((stepped.hot.ends.len(), stepped.hot.sweep(false)), (1, 0));

    // and so is the end beside the area
    let area = stepped.batches(2);
    assert!(stepped.orders.push(Order::Serve { place: 2, end: End::Broken }).is_ok());
    stepped.hot.handle_orders();
    let ends = stepped.hot.ends.iter_mut();
    let mine = ends.filter_map(|(place, end)| match end {
        End::Batches(batches) if *place == 2 => Some(batches),
        _ => None,
    });
    mine.for_each(|batches| batches.panics_at = Some(0));
    stepped.ask(&area, 1, 1);
    assert_eq!(stepped.hot.sweep(false), 1);
    let back: Vec<Retired> = std::iter::from_fn(|| stepped.retired.pop().ok()).collect();
    let broken = back.iter().filter(|(_, end)| matches!(end, End::Broken)).count();
    assert_eq!((back.len(), broken, stepped.hot.ends.len()), (2, 1, 1));
    assert!(back.iter().all(|(place, _)| *place == 2));
}

/// Requests a state through a lane.
fn request(stepped: &Stepped, lane: &mut ClaimedLane, sequence: u64, y: &[f64]) {
    let head = RequestHead {
        version: PROTOCOL_VERSION,
        plan: NUMBER.0,
        fingerprint: stepped.fingerprint,
        sequence,
        ..RequestHead::default()
    };
    assert!(store_numbers(lane.outbox.numbers(), y));
    lane.outbox.publish(head);
}

/// The status and the bits of the answer of this sequence, if it is there.
fn answer(stepped: &Stepped, lane: &mut ClaimedLane, sequence: u64) -> Option<(u32, Vec<u64>)> {
    let n = stepped.plan.want().len();
    let (head, numbers) = lane.inbox.poll()?;
    let bits = numbers[..n].iter().map(|x| x.to_bits()).collect();
    (head.sequence == sequence).then_some((head.status, bits))
}

#[test]
fn a_state_that_needs_more_than_a_turn_delays_nobody_and_has_the_bits_of_the_plan() {
    let root = std::env::temp_dir().join(format!("sarrus-aside-{}", std::process::id()));
    let domain = Domain::at(&root).unwrap();
    let run = Run::start(&domain, &ServerName::new("aside").unwrap()).unwrap();
    let (given, want) = (FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q, Field::NearestY]));
    // near zero a turn suffices; the others need longer, and one of them has no answer
    let good = [0.1, 0.1, 0.0];
    let long = [[-1.0, 0.5, -0.8], [0.9, 0.9, 0.9], [-2.2, 2.2, -2.2]];
    for options in [sarrus_proto::QueryOptions::NONE, sarrus_proto::QueryOptions::SEARCH] {
        let query = Query::new(Request::Kinematics, given, want).with_options(options);
        let mut stepped = Stepped::of("delta", query);
        let model = Arc::new(with_all_rows("delta"));
        let threads = [(); 2].map(|()| Aside::start(&model, "aside", 8, || {}).unwrap());
        stepped.hot.engine.set_aside(threads);
        let mut whole = sarrus_dynamics::Workspace::new(&model);
        let mut expect = |y: &[f64]| {
            let mut output = vec![0.0; stepped.plan.want().len()];
            let status = stepped.plan.run(&model, &mut whole, y, &mut output).status;
            (status as u32, output.iter().map(|x| x.to_bits()).collect::<Vec<u64>>())
        };
        let expected = long.map(|y| expect(&y));
        let of_good = expect(&good);
        assert_eq!(of_good.0, Status::Ok as u32);

        let mut honest = stepped.lane(&domain, &run, 0);
        let mut others = [1, 2, 3].map(|place| stepped.lane(&domain, &run, place));
        for (other, y) in others.iter_mut().zip(&long) {
            request(&stepped, &mut other.0, 1, y);
        }
        let mut found = [const { None }; 3];
        let mut sequence = 0;
        let mut waited = 0;
        while found.iter().any(Option::is_none) {
            sequence += 1;
            request(&stepped, &mut honest.0, sequence, &good);
            let answered = stepped.hot.sweep(false);
            assert_eq!(answer(&stepped, &mut honest.0, sequence).as_ref(), Some(&of_good));
            let mut new = 0;
            for (found, other) in found.iter_mut().zip(&mut others) {
                if found.is_none() {
                    *found = answer(&stepped, &mut other.0, 1);
                    new += usize::from(found.is_some());
                }
            }
            // at most one state for each client
            assert_eq!(answered, 1 + new);
            waited += usize::from(new == 0);
        }
        assert!(waited > 0, "no state was computed aside");
        assert_eq!(found.map(Option::unwrap), expected);

        // clients of cheap states wait for one such turn, those of costly ones for their own
        request(&stepped, &mut honest.0, sequence + 1, &good);
        request(&stepped, &mut others[0].0, 2, &long[1]);
        request(&stepped, &mut others[1].0, 2, &good);
        assert_eq!(stepped.hot.turn(1, false), 1);
        assert_eq!(answer(&stepped, &mut honest.0, sequence + 1).as_ref(), Some(&of_good));
        assert_eq!(answer(&stepped, &mut others[1].0, 2), None);
        assert_eq!(stepped.hot.turn(2, false), 1);
        assert_eq!(answer(&stepped, &mut others[1].0, 2).as_ref(), Some(&of_good));
        // now that one has a cheap state too
        request(&stepped, &mut others[1].0, 3, &good);
        request(&stepped, &mut others[2].0, 2, &long[2]);
        assert_eq!(stepped.hot.turn(3, false), 1);
        assert_eq!(answer(&stepped, &mut others[1].0, 3).as_ref(), Some(&of_good));

        // a client that is gone meanwhile holds nobody up
        request(&stepped, &mut others[1].0, 4, &long[2]);
        stepped.hot.sweep(false);
        for place in [1, 2] {
            assert!(stepped.orders.push(Order::Retire { place }).is_ok());
        }
        stepped.hot.handle_orders();
        request(&stepped, &mut others[2].0, 3, &long[0]);
        let last = loop {
            stepped.hot.sweep(false);
            if let Some(last) = answer(&stepped, &mut others[2].0, 3) {
                break last;
            }
        };
        assert_eq!(last, expected[0]);
        let [first, second, third] = others;
        drop((stepped, honest.0, first.0, second.0, third.0));
        for (nodes, link) in [(honest.1, honest.2), (first.1, first.2), (second.1, second.2)] {
            drop(nodes);
            link.remove();
        }
        drop(third.1);
        third.2.remove();
    }
    drop(run);
    domain.tidy();
}

#[test]
fn a_row_that_needs_more_than_a_turn_takes_one_and_has_the_bits_of_the_plan() {
    let query = Query::new(Request::Kinematics, Field::Y.into(), Field::Q.into());
    let mut stepped = Stepped::of("delta", query);
    let model = Arc::new(with_all_rows("delta"));
    let threads = [(); 2].map(|()| Aside::start(&model, "aside", 8, || {}).unwrap());
    stepped.hot.engine.set_aside(threads);
    let area = stepped.batches(0);
    let [good, long] = [[0.1, 0.1, 0.0], [-1.0, 0.5, -0.8]];
    let rows = [good, good, long, good, long, good];
    let [n_in, n_out] = [good.len(), stepped.plan.want().len()];
    assert_eq!(stepped.plan.abreast(), LANES, "its rows are closed apart");
    let shape = BatchShape::new(rows.len() as u64, n_in, n_out).unwrap();
    area.send(&stepped.head(1, rows.len()), &shape, rows.as_flattened());
    // each of both goes aside with the rows before it, and is not tried again
    let mut cut_after = Vec::new();
    while area.answer(1).is_none() {
        stepped.hot.answer_tile(false);
        stepped.hot.engine.end_sweep();
        if std::mem::take(&mut stepped.hot.engine.cut_short) {
            cut_after.push(area.done());
        }
    }
    assert_eq!((cut_after, area.answer(1)), (vec![2, 4], Some(Status::Ok as u32)));
    let mut found = vec![0.0; rows.len() * n_out];
    let mut answers = vec![CUT_SHORT; rows.len()];
    area.read(&shape, &mut answers, &mut found);
    let mut whole = sarrus_dynamics::Workspace::new(&model);
    for (k, y) in rows.iter().enumerate() {
        let mut output = vec![0.0; n_out];
        let answer = stepped.plan.run(&model, &mut whole, y, &mut output);
        let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(answers[k], answer, "row {k}");
        assert_eq!(bits(&found[k * n_out..][..n_out]), bits(&output), "row {k}");
    }
}

#[test]
fn the_heart_beats_between_two_states_once_it_is_due() {
    let mut stepped = Stepped::new();
    let areas = [0, 1].map(|place| stepped.batches(place));
    areas.iter().for_each(|area| stepped.ask(area, 1, ROWS));
    let descriptor = stepped.hot.heartbeat.reader_descriptor().unwrap();
    let reader = sarrus_proto::heartbeat::HeartbeatReader::new(&descriptor).unwrap();
    for beats in [1, 1, 0] {
        stepped.hot.beat = if beats == 1 { 0 } else { u64::MAX };
        let before = reader.read().beats;
        assert_eq!(stepped.hot.sweep(false), 1);
        assert_eq!(reader.read().beats - before, beats);
    }
}

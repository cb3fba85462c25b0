//! Batches through shared memory: the bits of single answers, also beside failures.

use std::fs::File;
use std::num::NonZero;
use std::os::unix::fs::MetadataExt;
use std::time::{Duration, Instant};

use sarrus_client::{
    Answer, Error, Field, FieldSet, Options, PlanId, Query, QueryOptions, Request, Robot, Source,
    Status, Transport, Warnings,
};
use sarrus_proto::batch::{BATCH_WORDS, BatchHead, BatchShape, ClaimedBatch, MAX_BATCH_ROWS};
use sarrus_proto::control::{Call, Refusal};

use sarrus_torture::patience::LIMIT;
use sarrus_torture::process::batch_areas;
use sarrus_torture::raw::Raw;

use crate::support::wait_until;
use crate::support::{Asker, ROBOT, STATE, Sandbox};

const UNKNOWN: Answer = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };

/// Rows of one plan, some of them beyond any pose and some not numbers, and their answers.
pub(crate) struct Rows {
    input: Vec<f64>,
    output: Vec<f64>,
    answers: Vec<Answer>,
}

impl Rows {
    pub(crate) fn new(asker: &Asker, n: usize) -> Rows {
        Rows::of(&asker.robot, asker.plan, n)
    }

    fn of(robot: &Robot, plan: PlanId, n: usize) -> Rows {
        let prepared = robot.plan(plan).unwrap();
        let n_in = prepared.given().len();
        let mut input = Vec::with_capacity(n * n_in);
        for row in 0..n {
            let scale = if row % 7 == 3 { 20.0 } else { 1e-3 };
            input.extend((0..n_in).map(|k| scale * ((row * 31 + k * 17) % 101) as f64));
            if row % 10 == 1 {
                let bad = [f64::NAN, f64::INFINITY, 1e300][row / 10 % 3];
                input[row * n_in + row % n_in] = bad;
            }
        }
        Rows { input, output: vec![0.0; n * prepared.want().len()], answers: vec![UNKNOWN; n] }
    }

    pub(crate) fn ask(&mut self, asker: &mut Asker) -> Result<(), Error> {
        self.ask_of(&mut asker.robot, asker.plan)
    }

    fn ask_of(&mut self, robot: &mut Robot, plan: PlanId) -> Result<(), Error> {
        let Rows { input, output, answers } = self;
        robot.batch(plan, NonZero::<usize>::MIN, input, output, answers)
    }

    /// Bits of the numbers, one for every NaN, and the answers.
    fn bits(&self) -> (Vec<u64>, Vec<Answer>) {
        let bits = |x: &f64| if x.is_nan() { u64::MAX } else { x.to_bits() };
        (self.output.iter().map(bits).collect(), self.answers.clone())
    }
}

/// Questions whose states go abreast, one whose states do not, and that with a search.
fn queries() -> [Query; 5] {
    use Field::*;
    let of = |request, given: &[Field], want: &[Field]| {
        Query::new(request, FieldSet::of(given), FieldSet::of(want))
    };
    [
        of(Request::InverseDynamics, &[Y, Yd, Ydd], &[TauU, TauY]),
        of(Request::ForwardDynamics, &[Y, Yd, TauY], &[Ydd, FramePose])
            .with_frames(&[1, 2])
            .with_wrenches(&[2]),
        of(Request::Kinematics, &[Y, Yd], &[Q, Qd, U, Ud]),
        of(Request::Kinematics, &[U], &[Q, G, Residual, NearestY]),
        of(Request::Kinematics, &[U], &[Q, NearestY]).with_options(QueryOptions::SEARCH),
    ]
}

fn local(robot: &str) -> Robot {
    Robot::load(&Source::Bundled(robot.into()), &Options::default()).unwrap()
}

#[test]
fn rows_of_a_batch_have_the_bits_of_single_answers() {
    let sandbox = Sandbox::new();
    for robot in ["lambda", ROBOT, "wrist"] {
        let server = sandbox.serve_robot(robot, "rows", &[]);
        let mut here = local(robot);
        for transport in [Transport::Lane, Transport::Service] {
            let mut there = sandbox.connect("rows", transport).unwrap();
            let mut statuses = [0; 2];
            for (query, options) in queries()
                .map(|query| (query, QueryOptions::NONE))
                .into_iter()
                .chain([(queries()[0], QueryOptions::CHECKSUM)])
            {
                let query = query.with_options(options);
                // more than one batch of the server, and no whole tile at the end
                let n = MAX_BATCH_ROWS + 251;
                let [of_here, plan] = [&mut here, &mut there].map(|x| x.prepare(&query).unwrap());
                let mut expected = Rows::of(&here, of_here, n);
                expected.ask_of(&mut here, of_here).unwrap();
                let mut rows = Rows::of(&there, plan, n);
                rows.ask_of(&mut there, plan).unwrap();
                assert!(rows.bits() == expected.bits(), "{robot}, {query:?}");

                // and of those that are asked alone
                let n_in = rows.input.len() / n;
                let n_out = rows.output.len() / n;
                for row in (0..n).step_by(29) {
                    let mut alone = Rows {
                        input: rows.input[row * n_in..][..n_in].to_vec(),
                        output: vec![0.0; n_out],
                        answers: vec![UNKNOWN],
                    };
                    alone.answers[0] = there.ask(plan, &alone.input, &mut alone.output).unwrap();
                    let (bits, answers) = expected.bits();
                    let expected = (bits[row * n_out..][..n_out].to_vec(), vec![answers[row]]);
                    assert_eq!(alone.bits(), expected, "{robot}, row {row}");
                }
                for answer in &rows.answers {
                    statuses[usize::from(answer.status != Status::Ok)] += 1;
                }
            }
            assert!(statuses.iter().all(|count| *count > 500), "{robot}: {statuses:?}");
            let counts = there.statistics().unwrap().counts;
            assert!(counts.batch_states >= 4 * MAX_BATCH_ROWS as u64, "{counts:?}");
        }
        assert!(server.stop().success());
    }
}

#[test]
fn a_batch_goes_on_after_a_larger_lane_and_after_another_server() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("moved", &[]);
    let mut here = local(ROBOT);
    let mut there = sandbox.connect("moved", Transport::Lane).unwrap();
    let [of_here, plan] = [&mut here, &mut there].map(|x| x.prepare(&queries()[2]).unwrap());
    let mut expected = Rows::of(&here, of_here, 2000);
    expected.ask_of(&mut here, of_here).unwrap();
    let mut rows = Rows::of(&there, plan, 2000);
    rows.ask_of(&mut there, plan).unwrap();
    assert!(rows.bits() == expected.bits());

    let all = FieldSet::of(&[Field::G, Field::K, Field::Q]);
    there.prepare(&Query::new(Request::Kinematics, Field::Y.into(), all)).unwrap();
    rows.ask_of(&mut there, plan).unwrap();
    assert!(rows.bits() == expected.bits());

    server.kill();
    let _server = sandbox.serve("moved", &[]);
    rows.ask_of(&mut there, plan).unwrap();
    assert!(rows.bits() == expected.bits());
    // rows that do not fit are no batch
    let outcome = there.batch(plan, NonZero::<usize>::MIN, &[0.0], &mut [0.0], &mut [UNKNOWN; 2]);
    assert!(outcome.is_ok());
    there.release(plan).unwrap();
    assert!(matches!(rows.ask_of(&mut there, plan), Err(Error::ReleasedPlan)));
    assert!(rows.output.iter().all(|x| x.is_nan()));
}

/// Asks and waits; the status of the batch.
fn answer(area: &ClaimedBatch, head: &BatchHead, shape: &BatchShape, input: &[f64]) -> u32 {
    area.send(head, shape, input);
    let start = Instant::now();
    loop {
        if let Some(status) = area.answer(head.sequence) {
            return status;
        }
        assert!(start.elapsed() < LIMIT, "no answer to {head:?}");
    }
}

#[test]
fn lies_in_a_batch_get_their_status_and_disturb_nobody() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("lies", &[]);
    let mut honest = Asker::new(sandbox.connect("lies", Transport::Lane).unwrap());
    let n_in = honest.input.len();
    let n_out = honest.output.len();
    let liar = sandbox.raw("lies");
    let no_end = Ok(Err(Refusal::NoEnd));
    assert_eq!(liar.try_call(Call::Batch), no_end, "beside a lane or a service");
    assert!(liar.call(Call::Service).is_ok());
    assert_eq!(liar.try_call(Call::Batch), no_end, "beside one that is polled");
    let (_node, _lane) = liar.take_lane([n_in, n_out]).unwrap();
    let (area, _) = liar.batches().unwrap();
    let (again, _) = liar.batches().unwrap();

    let good = liar.batch_head(0, 0, 9);
    let BatchHead { version, fingerprint, .. } = good;
    let cases = [
        (BatchHead { version: version + 1, ..good }, Status::BadRequest),
        (BatchHead { fingerprint: fingerprint ^ 1, ..good }, Status::WrongModel),
        (BatchHead { plan: 1, ..good }, Status::UnknownRequest),
        (BatchHead { plan: u32::MAX, ..good }, Status::UnknownRequest),
        (BatchHead { rows: 0, ..good }, Status::WrongSize),
        (BatchHead { rows: MAX_BATCH_ROWS as u64 + 1, ..good }, Status::WrongSize),
        (BatchHead { rows: u64::MAX, ..good }, Status::WrongSize),
        (good, Status::Ok),
        (BatchHead { rows: 1, ..good }, Status::Ok),
        (BatchHead { rows: MAX_BATCH_ROWS as u64, ..good }, Status::Ok),
    ];
    for (k, (head, status)) in cases.into_iter().enumerate() {
        let head = BatchHead { sequence: k as u64 + 1, ..head };
        let rows = head.rows.clamp(1, MAX_BATCH_ROWS as u64);
        let shape = BatchShape::new(rows, n_in, n_out).unwrap();
        let mut input = vec![0.0; shape.rows() * n_in];
        input[n_in - 1] = f64::NAN;
        assert_eq!(answer(&area, &head, &shape, &input), status as u32, "{head:?}");
        if status == Status::Ok {
            let mut answers = vec![UNKNOWN; shape.rows()];
            let mut output = vec![0.0; shape.rows() * n_out];
            again.read(&shape, &mut answers, &mut output);
            assert_eq!(answers[0].status, Status::NonFiniteInput);
            assert!(answers[1..].iter().all(|answer| answer.status == Status::Ok));
            assert!(output[..n_out].iter().all(|x| x.is_nan()));
            assert!(output[n_out..].iter().all(|x| x.is_finite()));
        }
        assert_eq!(honest.ask().unwrap().status, Status::Ok);
    }

    // a plan with a checksum has none in a batch; rows that change while they are answered
    let (checked, _) = liar.plan(&STATE.with_options(QueryOptions::CHECKSUM)).unwrap();
    let shape = BatchShape::new(MAX_BATCH_ROWS as u64, n_in, n_out).unwrap();
    let head = BatchHead { plan: checked, sequence: 100, rows: MAX_BATCH_ROWS as u64, ..good };
    let mut input = vec![0.0; MAX_BATCH_ROWS * n_in];
    assert_eq!(answer(&area, &head, &shape, &input), Status::CorruptAnswer as u32);
    for sequence in 101..400 {
        input.fill([f64::NAN, 1e300, -0.0, 0.1][sequence as usize % 4]);
        area.send(&BatchHead { plan: 0, sequence, ..head }, &shape, &input);
        assert_eq!(honest.ask().unwrap().status, Status::Ok);
    }
    let last = BatchHead { plan: 0, sequence: 500, ..head };
    let status = Status::from_code(answer(&area, &last, &shape, &input)).unwrap();
    assert!([Status::Ok, Status::Overloaded].contains(&status), "{status:?}");
    assert!(honest.robot.statistics().unwrap().answered(Status::Overloaded) > 0);

    // an area that is given back is polled no more
    assert!(liar.call(Call::Leave).is_ok());
    area.send(&BatchHead { sequence: 501, ..last }, &shape, &input);
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!((area.answer(501), liar.try_call(Call::Batch)), (None, no_end));
    drop((area, again, liar, honest));
    assert!(server.stop().success());
}

#[test]
fn a_client_that_dies_in_a_batch_leaves_nothing_and_holds_nobody_up() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("fallen", &["--lanes", "4"]);
    let mut honest = Asker::new(sandbox.connect("fallen", Transport::Lane).unwrap());
    let areas = || batch_areas(server.id());
    for _ in 0..3 {
        let clients = [Transport::Lane, Transport::Service, Transport::Lane]
            .map(|transport| sandbox.flooding("fallen", transport));
        assert_eq!(areas(), 3);
        for client in clients {
            client.kill();
            for _ in 0..100 {
                assert_eq!(honest.ask().unwrap().status, Status::Ok);
            }
        }
        wait_until("no area is mapped", || areas() == 0);
    }
    drop(honest);
    assert!(server.stop().success());
    assert_eq!(sandbox.leftovers(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn areas_that_were_given_back_take_no_memory_in_a_client_that_keeps_them() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("kept", &["--lanes", "2"]);
    let liar = sandbox.raw("kept");
    let take = |liar: &Raw| {
        assert!(liar.call(Call::Lane { n_in: 1, n_out: 1 }).is_ok());
        let memory = File::from(liar.batches().unwrap().1);
        assert_eq!(blocks(&memory), 8 * BATCH_WORDS as u64 / 512);
        assert!(memory.set_len(0).is_err() && memory.set_len(1 << 30).is_err());
        memory
    };
    let mut kept = Vec::new();
    for _ in 0..200 {
        kept.push(take(&liar));
        assert!(liar.call(Call::Leave).is_ok());
    }
    // and those of connections that end
    for _ in 0..20 {
        kept.push(take(&sandbox.raw("kept")));
    }
    wait_until("their memory is free", || kept.iter().all(|memory| blocks(memory) == 0));
    drop(liar);
    assert!(server.stop().success());
}

/// Memory that a file takes, in pieces of 512 bytes.
fn blocks(memory: &File) -> u64 {
    memory.metadata().unwrap().blocks()
}

#[test]
fn a_batch_during_a_stop_is_refused_not_lost() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("closed", &[]);
    let mut asker = sandbox.attach_briefly("closed", Transport::Lane);
    let mut rows = Rows::new(&asker, MAX_BATCH_ROWS);
    rows.ask(&mut asker).unwrap();
    let stop = std::thread::spawn(move || server.stop());
    let start = Instant::now();
    let mut asked = Ok(());
    while asked.is_ok() && rows.answers[0].status == Status::Ok && start.elapsed() < LIMIT {
        asked = rows.ask(&mut asker);
    }
    // a client that asks a tenth of a second later finds no server
    let status = if asked.is_ok() { Status::ShuttingDown } else { Status::UnknownRequest };
    assert!(rows.answers.iter().all(|answer| answer.status == status), "{asked:?}");
    assert!(rows.output.iter().all(|x| x.is_nan()));
    assert!(stop.join().unwrap().success());
}

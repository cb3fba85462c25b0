//! Clients that only ask, and compare every answer with that of a robot in this process.

use std::num::NonZero;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fastrand::Rng;
use sarrus_client::{
    Answer, ConnectError, ConnectOptions, Domain, Error, PlanId, Robot, Status, Transport,
    WaitStrategy, Warnings,
};

use crate::oracle::{Oracle, Question, is_refusal};
use crate::patience::deadline;
use crate::report::Report;
use crate::sandbox::NAME;

/// Both ways to ask.
pub(crate) const TRANSPORTS: [Transport; 2] = [Transport::Lane, Transport::Service];
/// An answer that takes longer is late.
const LATE: Duration = Duration::from_secs(1);

/// A client that asks.
pub(crate) struct Honest {
    pub(crate) robot: Robot,
    plans: Vec<PlanId>,
    oracle: Arc<Oracle>,
    output: Vec<f64>,
    random: Rng,
    pub(crate) counts: Counts,
}

/// Counts of honest clients.
#[derive(Clone, Debug, Default)]
pub(crate) struct Counts {
    /// Answers that were compared.
    pub(crate) answers: u64,
    /// Answers with another status, other warnings or other bits.
    pub(crate) wrong: u64,
    /// Requests that were refused by a status.
    pub(crate) refused: u64,
    /// Requests that ended with an error.
    pub(crate) lost: u64,
    /// Answers after more than [`LATE`].
    pub(crate) late: u64,
    /// The slowest answer.
    pub(crate) slowest: Duration,
    /// The first wrong answer, and the first error.
    pub(crate) first_wrong: Option<String>,
    pub(crate) first_error: Option<String>,
}

impl Honest {
    pub(crate) fn connect(
        domain: &Domain,
        transport: Transport,
        timeout: Duration,
        oracle: &Arc<Oracle>,
        seed: u64,
    ) -> Result<Honest, Error> {
        let wait_strategy = WaitStrategy::Polite;
        let options =
            ConnectOptions { transport, timeout, wait_strategy, ..ConnectOptions::default() };
        let mut robot = Robot::connect_in(domain.clone(), NAME, options)?;
        let plans = oracle.queries.iter().map(|query| robot.prepare(query));
        let plans = plans.collect::<Result<Vec<_>, _>>()?;
        let oracle = oracle.clone();
        let random = Rng::with_seed(seed);
        Ok(Honest { robot, plans, oracle, output: Vec::new(), random, counts: Counts::default() })
    }

    /// Asks once, compares and counts.
    pub(crate) fn ask(&mut self) -> Result<(), Error> {
        let Some(question) = self.oracle.any(&mut self.random) else { return Ok(()) };
        let Some(plan) = self.plans.get(question.query) else { return Ok(()) };
        self.output.clear();
        self.output.resize(question.output.len(), 0.0);
        let start = Instant::now();
        let outcome = self.robot.ask(*plan, &question.input, &mut self.output);
        let took = start.elapsed();
        let counts = &mut self.counts;
        let answer = match outcome {
            Ok(answer) => answer,
            Err(error) => {
                counts.lost += 1;
                counts.first_error.get_or_insert_with(|| error.to_string());
                return Err(error);
            }
        };
        let status = answer.status as u32;
        if is_refusal(status) {
            counts.refused += 1;
            return Ok(());
        }
        counts.late += u64::from(took > LATE);
        counts.slowest = counts.slowest.max(took);
        counts.compare(question, status, answer.warnings.0, &self.output);
        Ok(())
    }

    /// Asks for up to `most` rows of one query together, compares each and counts.
    pub(crate) fn ask_rows(&mut self, most: usize) -> Result<(), Error> {
        let Some(query) = self.oracle.any(&mut self.random).map(|one| one.query) else {
            return Ok(());
        };
        let Some(plan) = self.plans.get(query) else { return Ok(()) };
        let of_query = |question: &&Question| question.query == query;
        let rows = 1 + self.random.usize(..most.max(1));
        let questions: Vec<&Question> =
            self.oracle.questions.iter().filter(of_query).cycle().take(rows).collect();
        let input: Vec<f64> = questions.iter().flat_map(|one| one.input.clone()).collect();
        let n_out = questions.first().map_or(0, |one| one.output.len());
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut output = vec![0.0; rows * n_out];
        let mut answers = vec![unknown; rows];
        let start = Instant::now();
        let outcome =
            self.robot.batch(*plan, NonZero::<usize>::MIN, &input, &mut output, &mut answers);
        let took = start.elapsed();
        let counts = &mut self.counts;
        if let Err(error) = outcome {
            counts.lost += 1;
            counts.first_error.get_or_insert_with(|| error.to_string());
            return Err(error);
        }
        counts.late += u64::from(took > LATE);
        counts.slowest = counts.slowest.max(took);
        for (question, (answer, output)) in
            questions.iter().zip(answers.iter().zip(output.chunks(n_out.max(1))))
        {
            let status = answer.status as u32;
            match is_refusal(status) {
                true => counts.refused += 1,
                false => counts.compare(question, status, answer.warnings.0, output),
            }
        }
        Ok(())
    }
}

impl Counts {
    /// Counts an answer, and whether it is the right one.
    fn compare(&mut self, question: &Question, status: u32, warnings: u32, output: &[f64]) {
        self.answers += 1;
        if !question.is_answered_by(status, warnings, output) {
            self.wrong += 1;
            self.first_wrong.get_or_insert_with(|| {
                format!(
                    "query {}: status {status} instead of {}, warnings {warnings} instead of {}, \
                     {output:?} instead of {:?}",
                    question.query, question.status, question.warnings, question.output
                )
            });
        }
    }

    pub(crate) fn add(&mut self, other: Counts) {
        self.answers += other.answers;
        self.wrong += other.wrong;
        self.refused += other.refused;
        self.lost += other.lost;
        self.late += other.late;
        self.slowest = self.slowest.max(other.slowest);
        self.first_wrong = self.first_wrong.take().or(other.first_wrong);
        self.first_error = self.first_error.take().or(other.first_error);
    }

    /// Adds the counts to a report; wrong answers are faults, and lost ones unless `may_lose`.
    pub(crate) fn report(&self, report: &mut Report, who: &str, may_lose: bool) {
        report.count(format!(
            "{who}: {} answers, {} wrong, {} lost, {} refused, {} late, slowest {:.1} ms",
            self.answers,
            self.wrong,
            self.lost,
            self.refused,
            self.late,
            1e3 * self.slowest.as_secs_f64()
        ));
        let words = |text: &Option<String>| text.clone().unwrap_or_default();
        report.require(self.wrong == 0, || {
            format!("{who}: {} wrong answers: {}", self.wrong, words(&self.first_wrong))
        });
        report.require(may_lose || self.lost == 0, || {
            format!("{who}: {} requests lost: {}", self.lost, words(&self.first_error))
        });
        report.require(self.answers > 0, || format!("{who}: no answer at all"));
    }
}

/// Honest clients in threads of their own.
pub(crate) struct Askers {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Counts>>,
}

impl Askers {
    /// `n` clients through each transport, which ask until [`Askers::finish`].
    pub(crate) fn start(
        domain: &Domain,
        oracle: &Arc<Oracle>,
        n: usize,
        timeout: Duration,
        seed: u64,
    ) -> Result<Askers, String> {
        Askers::start_with(domain, oracle, n, timeout, seed, |honest, _| {
            let _ = honest.ask();
        })
    }

    /// `n` clients through each transport, which call `ask` until [`Askers::finish`].
    pub(crate) fn start_with(
        domain: &Domain,
        oracle: &Arc<Oracle>,
        n: usize,
        timeout: Duration,
        seed: u64,
        ask: impl FnMut(&mut Honest, usize) + Clone + Send + 'static,
    ) -> Result<Askers, String> {
        let stop = Arc::new(AtomicBool::new(false));
        let mut askers = Askers { stop: stop.clone(), threads: Vec::new() };
        for number in 0..2 * n {
            let transport = TRANSPORTS[number % 2];
            let seed = seed.wrapping_add(number as u64);
            // a short time-out may end before a busy server answers the first calls
            let deadline = deadline();
            let mut honest = loop {
                match Honest::connect(domain, transport, timeout, oracle, seed) {
                    Ok(honest) => break honest,
                    Err(_) if Instant::now() < deadline => {}
                    Err(error) => return Err(format!("an honest client cannot attach: {error}")),
                }
            };
            let stop = stop.clone();
            let mut ask = ask.clone();
            askers.threads.push(std::thread::spawn(move || {
                while !stop.load(Relaxed) {
                    ask(&mut honest, number);
                    // a controller has a period
                    std::thread::sleep(Duration::from_micros(200));
                }
                honest.counts
            }));
        }
        Ok(askers)
    }

    /// Ends the clients; the sum of their counts.
    pub(crate) fn finish(mut self) -> Counts {
        self.stop.store(true, Relaxed);
        let mut counts = Counts::default();
        for thread in self.threads.drain(..) {
            match thread.join() {
                Ok(more) => counts.add(more),
                Err(_) => counts.lost += 1,
            }
        }
        counts
    }
}

impl Drop for Askers {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
    }
}

/// True of the error that there is no room for another client.
pub(crate) fn is_full(error: &Error) -> bool {
    matches!(error, Error::Connect(ConnectError::NoFreeSlot { .. }))
}

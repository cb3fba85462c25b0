//! Computes the answers of a recording again and compares them bit by bit.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{Read, Seek};

use sarrus_dynamics::{Model, Plan, Workspace};
use sarrus_proto::{Layout, Query, Status, Warnings};
use serde::Serialize;

use super::error::RecordingError;
use super::read::{Entry, Gaps, Recording};

/// Most differences in the report.
const SHOWN: usize = 10;
/// Most plans in the cache; a server holds no more at once.
const PLANS: usize = sarrus_proto::message::MAX_PLANS;

/// The outcome of a replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Replayed {
    /// Recorded requests.
    pub requests: u64,
    /// From the first of them to the last `[s]`.
    pub seconds: f64,
    /// The requested length `[s]`.
    pub asked_seconds: u64,
    /// Whether older records were overwritten.
    pub overwritten: bool,
    /// Number of lanes with requests, plus one for the service.
    pub clients: usize,
    /// Requests in this time that were answered and not recorded.
    pub lost: u64,
    /// Records that cannot be read.
    pub damaged: u64,
    /// True when the last record was cut off while it was written.
    pub cut_off: bool,
    /// Requests that were refused before any plan ran: nothing to compute.
    pub refused: u64,
    /// Requests with a plan that this version cannot make.
    pub unplanned: u64,
    /// Recorded answers by status.
    pub statuses: BTreeMap<&'static str, u64>,
    /// Answers that differ.
    pub differing_answers: u64,
    /// Differing bits, in statuses, warnings and numbers.
    pub differing_bits: u64,
    /// The first of them.
    pub differences: Vec<Difference>,
}

impl Replayed {
    /// True if the recording is complete and every answer is the same.
    pub fn is_same(&self) -> bool {
        self.differing_answers == 0 && self.damaged == 0 && self.unplanned == 0
    }
}

/// The first difference of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Difference {
    /// Time of the request, from the start of the recording `[s]`.
    pub time: f64,
    /// The client.
    pub client: String,
    /// The client's count of its requests.
    pub sequence: u64,
    /// The plan's number on the wire.
    pub plan: u32,
    /// `status`, `warnings`, or the number's field and index in it.
    pub field: String,
    /// The answer of the server.
    pub recorded: String,
    /// The answer of this computation.
    pub computed: String,
}

/// Computes every answer again, on the recording's model; `progress` gets the fraction done.
///
/// # Errors
/// [`RecordingError::WrongModel`], [`RecordingError::Read`], [`RecordingError::Holes`].
pub fn replay<R: Read + Seek>(
    recording: &mut Recording<R>,
    model: &Model<f64>,
    mut progress: impl FnMut(f64),
) -> Result<Replayed, RecordingError> {
    let found = model.fingerprint();
    let expected = recording.fingerprint();
    if found != expected {
        return Err(RecordingError::WrongModel { found, expected });
    }
    let mut again = Again {
        model,
        workspace: Workspace::new(model),
        plans: HashMap::new(),
        output: Vec::new(),
        replayed: Replayed {
            asked_seconds: recording.seconds(),
            overwritten: recording.is_full(),
            ..Replayed::default()
        },
    };
    let mut first = None;
    let mut last = (0, 0);
    let mut clients = BTreeSet::new();
    let Gaps { damaged, cut_off } = recording.read(|entry, done| {
        first.get_or_insert((entry.time_ns, entry.lost));
        last = (entry.time_ns, entry.lost);
        clients.insert(entry.client);
        again.compare(entry);
        progress(done);
    })?;
    let (first_ns, first_lost) = first.unwrap_or_default();
    Ok(Replayed {
        seconds: 1e-9 * last.0.saturating_sub(first_ns) as f64,
        lost: last.1.saturating_sub(first_lost),
        clients: clients.len(),
        damaged,
        cut_off,
        ..again.replayed
    })
}

/// The computation of all answers.
struct Again<'a> {
    model: &'a Model<f64>,
    workspace: Workspace<f64>,
    plans: HashMap<Query, Option<Plan>>,
    output: Vec<f64>,
    replayed: Replayed,
}

impl Again<'_> {
    fn compare(&mut self, entry: &Entry<'_>) {
        self.replayed.requests += 1;
        *self.replayed.statuses.entry(entry.status().name()).or_default() += 1;
        let Some(query) = entry.query else {
            self.replayed.refused += 1;
            return;
        };
        if self.plans.len() > PLANS {
            self.plans.clear();
        }
        let plan = self.plans.entry(query).or_insert_with(|| Plan::new(self.model, &query).ok());
        let fitting = plan.as_ref().filter(|plan| {
            (plan.given().len(), plan.want().len()) == (entry.input.len(), entry.output.len())
        });
        let Some(plan) = fitting else {
            self.replayed.unplanned += 1;
            return;
        };
        self.output.clear();
        self.output.resize(entry.output.len(), 0.0);
        let answer =
            Entry::code(plan.run(self.model, &mut self.workspace, entry.input, &mut self.output));

        let numbers = || entry.output.iter().zip(&self.output);
        let bits_of_numbers = numbers().map(|(a, b)| (a.to_bits() ^ b.to_bits()).count_ones());
        let codes = entry.answer.iter().zip(&answer).map(|(a, b)| (a ^ b).count_ones());
        let bits = codes.chain(bits_of_numbers).map(u64::from).sum::<u64>();
        if bits == 0 {
            return;
        }
        self.replayed.differing_answers += 1;
        self.replayed.differing_bits += bits;
        if self.replayed.differences.len() < SHOWN {
            let difference = first_difference(entry, answer, &self.output, plan.want());
            self.replayed.differences.push(difference);
        }
    }
}

fn first_difference(
    entry: &Entry<'_>,
    [status, warnings]: [u32; 2],
    output: &[f64],
    want: &Layout,
) -> Difference {
    let words = |bits| format!("{:?}", Warnings(bits));
    let mut numbers = entry.output.iter().zip(output).enumerate();
    let (field, recorded, computed) = if entry.answer[0] != status {
        let name = |code| Status::of_answer(code).name().to_owned();
        ("status".to_owned(), name(entry.answer[0]), name(status))
    } else if entry.answer[1] != warnings {
        ("warnings".to_owned(), words(entry.answer[1]), words(warnings))
    } else if let Some((k, (a, b))) = numbers.find(|(_, (a, b))| a.to_bits() != b.to_bits()) {
        (name_of(want, k), in_words(*a), in_words(*b))
    } else {
        Default::default()
    };
    Difference {
        time: 1e-9 * entry.time_ns as f64,
        client: entry.client.to_string(),
        sequence: entry.sequence,
        plan: entry.plan,
        field,
        recorded,
        computed,
    }
}

/// Field and index of a number.
fn name_of(layout: &Layout, index: usize) -> String {
    let slot = layout.slots().iter().find(|slot| slot.range().contains(&index));
    slot.map_or_else(
        || format!("[{index}]"),
        |slot| format!("{}[{}]", slot.field.name(), index - slot.offset),
    )
}

/// A number as text; different bits give different texts.
fn in_words(number: f64) -> String {
    if number.is_nan() { format!("NaN {:#x}", number.to_bits()) } else { format!("{number:?}") }
}

//! `sarrus ask`: JSON lines in, JSON lines out, one for one.
//!
//! A line that is no valid request gets `bad_request` with a column and a reason, and the command
//! ends with 1. A list of the wrong length (`wrong_size`) or a number beyond the range of a double
//! (`non_finite_input`) is a failed state of a valid request: its wanted fields are null, column
//! and reason follow them. While a server is lost, lines get `shutting_down` (`wrong_model` if
//! another robot took its place); the command ends with 2.

mod answer;
mod engine;
mod fields;
mod json;
mod lines;
mod read;
mod request;
mod tasks;

use std::io::{self, ErrorKind};
use std::num::NonZeroUsize;

use clap::Args;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use sarrus_client::{
    Answer, Error, Field, FieldSet, Layout, ModelInfo, Query, Request, Robot, Status, Warnings,
};
use sarrus_proto::Tolerance;
use sarrus_proto::message::{MAX_NUMBERS_IN, MAX_NUMBERS_OUT};

use super::output::{Failure, Outcome, Results, print};
use super::robot::RobotFlags;
use super::{Choices, choice};
use answer::Remark;
use engine::{Engine, Reply};
use lines::{LONGEST, Line, Lines, Patient};
use request::{Asked, Problem};

/// Flags of `ask`.
#[derive(Args)]
#[command(after_long_help = fields::table_in_words())]
pub(crate) struct Ask {
    /// The request of every line.
    #[arg(
        value_parser = choice(&REQUESTS),
        value_name = "REQUEST",
        required_unless_present = "fields"
    )]
    request: Option<Request>,
    /// Prints the table of the fields of requests and answers: name, shape, unit, meaning.
    #[arg(long, group = "SourceFlags")]
    fields: bool,
    /// A running server; its model was chosen when it was started.
    #[arg(
        long,
        value_name = "NAME",
        group = "SourceFlags",
        conflicts_with_all = [
            "submechanisms",
            "submechanisms_file",
            "gravity",
            "lenient",
            "floating_base",
            "lock",
            "only",
        ]
    )]
    connect: Option<String>,
    #[command(flatten)]
    robot: RobotFlags,
    /// Gap of redundant rows, in radians or lengths of the cluster, from which on an answer carries
    /// `loop_open`; a line's own `loop_tolerance` comes first.
    #[arg(long, value_name = "X", default_value_t = USUAL, value_parser = tolerance)]
    loop_tolerance: f64,
    /// Distance of the given q or q̇ from the answer's, in radians or lengths of the cluster, from
    /// which on it carries `input_projected`; a line's own `projection_tolerance` comes first.
    #[arg(long, value_name = "X", default_value_t = USUAL, value_parser = tolerance)]
    projection_tolerance: f64,
    /// Answers up to N lines together: same lines, same order, written when N are there or the
    /// input pauses. Lines with the same query share their computation.
    #[arg(long, value_name = "N", default_value_t = NonZeroUsize::MIN)]
    batch: NonZeroUsize,
}

/// Bytes of lines and answers from which on they are written, for any `--batch`.
const MOST_UNWRITTEN: usize = 1 << 20;

/// The tolerance of a query without one.
const USUAL: f64 = Tolerance::USUAL.bound();

/// A number from 0 on.
fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x >= 0.0 => Ok(x),
        _ => Err("expected a number from 0 on".to_owned()),
    }
}

const REQUESTS: Choices<Request, 8> = [
    (Request::Kinematics, "kinematics", "Positions, velocities, accelerations, closures, frames"),
    (Request::InverseDynamics, "inverse-dynamics", "Motion to forces"),
    (Request::ForwardDynamics, "forward-dynamics", "Forces to motion"),
    (Request::Map, "map", "One space to another"),
    (Request::Observe, "observe", "Motion and actuator forces to forces from outside"),
    (Request::InverseKinematics, "ik", "Poses of frames to the positions that reach them"),
    (Request::DifferentialInverseKinematics, "diff-ik", "Twists of frames to a velocity"),
    (Request::Step, "step", "Accelerations of frames to forces of actuators and contacts"),
];

impl Ask {
    pub(crate) fn run(self) -> Outcome {
        let Some(request) = self.request else {
            return Ok(Results { text: fields::table_in_words(), code: 0 });
        };
        let tolerances = [self.loop_tolerance, self.projection_tolerance].map(Tolerance::new);
        let engine = match &self.connect {
            Some(name) => Engine::connect(name).map_err(Failure::start)?,
            None => Engine::new(Robot::from_model(self.robot.load_and_warn()?.compiled)),
        };
        let model = engine.robot.model().clone();
        let code = Session { request, tolerances, model, engine }.run(self.batch.get())?;
        Ok(Results { text: String::new(), code })
    }
}

/// A model that answers line by line.
struct Session {
    request: Request,
    /// Of loops and of projection, for lines without their own.
    tolerances: [Tolerance; 2],
    model: ModelInfo,
    engine: Engine,
}

/// A line that was read and has no printed answer yet.
enum Item {
    /// Answered without computation.
    Answered(Status, Vec<u8>),
    Asked(Box<Question>),
}

/// The request of a line and its reply.
struct Question {
    asked: Asked,
    /// The column of the given positions.
    column: usize,
    input: Vec<f64>,
    want: Layout,
    /// Packed in the layout `want`.
    numbers: Vec<f64>,
    reply: Option<Reply>,
}

impl Session {
    /// Answers stdin to its end; the exit code.
    fn run(mut self, batch: usize) -> Result<u8, Failure> {
        let mut lines = Lines::new(Patient(io::stdin().lock()));
        // lines without an answer, and the bytes that they take
        let mut items = Vec::new();
        let mut bytes = 0;
        let mut every_line_good = true;
        loop {
            let line = match lines.next() {
                Ok(line) => line,
                Err(error) => {
                    let (text, _) = self.answer(&mut items);
                    let _ = print(&text);
                    return Err(Failure::start(format!("stdin cannot be read: {error}")));
                }
            };
            let is_end = matches!(line, Line::End);
            match line {
                Line::End => {}
                Line::Text(line) => items.push(self.read(line)),
                Line::TooLong => {
                    let words = format!("a line of more than {LONGEST} bytes, expected fewer");
                    items.push(Item::bad(&Remark { column: Some(LONGEST + 1), words }));
                }
            }
            bytes += items.last().map_or(0, Item::bytes);
            // an error of the input is reported when its line is next
            let goes_on = items.len() < batch && bytes < MOST_UNWRITTEN && !is_end;
            if goes_on && !lines.would_wait(has_input).unwrap_or(true) {
                continue;
            }
            let (text, all_good) = self.answer(&mut items);
            every_line_good &= all_good;
            bytes = 0;
            match print(&text) {
                Ok(()) if is_end => break,
                Ok(()) => {}
                Err(error) if error.kind() == ErrorKind::BrokenPipe => break,
                Err(error) => {
                    return Err(Failure::start(format!("the answers cannot be written: {error}")));
                }
            }
        }
        Ok(if self.engine.was_lost { 2 } else { u8::from(!every_line_good) })
    }

    /// Reads a line.
    fn read(&self, line: &[u8]) -> Item {
        let text = match std::str::from_utf8(line) {
            Ok(text) => text,
            Err(_) => {
                let valid = line.utf8_chunks().next().map_or("", |chunk| chunk.valid());
                let column = Some(column(valid, line.len()));
                return Item::bad(&Remark { column, words: "a byte that is no UTF-8".to_owned() });
            }
        };
        let remark = |Problem { offset, words, .. }: Problem| Remark {
            column: Some(column(text, offset)),
            words,
        };
        let read = read::read(Some(self.request), self.tolerances, &self.model, text);
        let mut asked = match read {
            Ok(asked) => asked,
            Err(problem) => return Item::bad(&remark(problem)),
        };

        // a state that fails without computation
        if let Some(problem) = asked.doubt.take() {
            let failed = Answer { status: problem.status, warnings: Warnings::NONE };
            let nothing = Layout::of_want(
                &Query::new(self.request, FieldSet::EMPTY, FieldSet::EMPTY),
                &self.model,
            );
            let mut out = Vec::new();
            let remark = remark(problem);
            answer::answer(&mut out, &asked, &self.model, failed, &nothing, &[], Some(&remark));
            return Item::Answered(failed.status, out);
        }

        let given = Layout::of_given(&asked.query, &self.model.sizes);
        let positions = [Field::Y, Field::Q, Field::QGuess];
        let mut fields = asked.given.iter();
        let offset = fields.find(|given| positions.contains(&given.field)).map_or(0, |x| x.offset);
        let mut question = Question {
            column: column(text, offset),
            input: packed(&asked, &given),
            want: Layout::of_want(&asked.query, &self.model),
            numbers: Vec::new(),
            reply: None,
            asked,
        };
        let n_in = given.len();
        let n_out = question.want.len();
        if n_in > MAX_NUMBERS_IN || n_out > MAX_NUMBERS_OUT {
            // the bounds of a server hold in process too, so that a line has one answer
            let max_in = MAX_NUMBERS_IN;
            let max_out = MAX_NUMBERS_OUT;
            let error = Error::TooLarge { n_in, n_out, max_in, max_out };
            question.reply = Some(Reply::failed(Status::BadRequest, error.to_string()));
        } else {
            question.numbers.resize(n_out, f64::NAN);
        }
        Item::Asked(Box::new(question))
    }

    /// Takes all lines; their answers, and whether each line was a valid request.
    fn answer(&mut self, items: &mut Vec<Item>) -> (Vec<u8>, bool) {
        self.ask(items);
        let mut text = Vec::new();
        let mut all_good = true;
        for item in items.drain(..) {
            let status = match item {
                Item::Answered(status, answer) => {
                    text.extend(answer);
                    status
                }
                Item::Asked(question) => self.write(*question, &mut text),
            };
            all_good &= status != Status::BadRequest;
        }
        (text, all_good)
    }

    /// Asks, lines with the same query together, and once more without the actuators' Jacobian
    /// where it alone fails.
    fn ask(&mut self, items: &mut [Item]) {
        let mut open: Vec<&mut Question> = items
            .iter_mut()
            .filter_map(|item| match item {
                Item::Asked(question) if question.reply.is_none() => Some(&mut **question),
                _ => None,
            })
            .collect();
        while let Some(first) = open.first() {
            let Asked { query, deadline, .. } = first.asked;
            let is_alike =
                |one: &&mut Question| one.asked.query == query && one.asked.deadline == deadline;
            let (mut alike, others): (Vec<_>, Vec<_>) = open.into_iter().partition(is_alike);
            open = others;
            let input: Vec<f64> = alike.iter().flat_map(|one| &one.input).copied().collect();
            let n_out = alike.first().map_or(0, |one| one.numbers.len());
            let mut output = vec![f64::NAN; alike.len() * n_out];
            let replies = self.engine.ask(&query, deadline, alike.len(), &input, &mut output);
            for (row, (question, reply)) in alike.drain(..).zip(replies).enumerate() {
                if reply.answer.status == Status::SingularActuation
                    && query.want.has(Field::JacobianActuator)
                {
                    let actuator = FieldSet::of(&[Field::JacobianActuator]);
                    question.asked.query.want = FieldSet(query.want.0 & !actuator.0);
                    question.want = Layout::of_want(&question.asked.query, &self.model);
                    question.numbers.resize(question.want.len(), f64::NAN);
                    open.push(question);
                    continue;
                }
                let numbers = output.get(row * n_out..(row + 1) * n_out);
                question.numbers.copy_from_slice(numbers.unwrap_or_default());
                question.reply = Some(reply);
            }
        }
    }

    /// Writes the answer to a line; its status.
    fn write(&self, question: Question, out: &mut Vec<u8>) -> Status {
        let Question { asked, column, want, numbers, reply, .. } = question;
        let Some(Reply { answer, words }) = reply else { return Status::Ok };
        if answer.status == Status::BadRequest {
            // sizes and finite numbers were checked before
            let words = words.unwrap_or_else(|| {
                "a quaternion is not of unit length, expected one within 1e-6 of it, or a task's \
                 axis has no length, or a free joint has bounds"
                    .to_owned()
            });
            answer::bad_request(out, &Remark { column: Some(column), words });
        } else {
            let words = words.or_else(|| reason(answer.status, &want, &numbers).map(str::to_owned));
            let remark = words.map(|words| Remark { column: None, words });
            answer::answer(out, &asked, &self.model, answer, &want, &numbers, remark.as_ref());
        }
        answer.status
    }
}

impl Item {
    /// A line that is no request.
    fn bad(remark: &Remark) -> Item {
        let mut out = Vec::new();
        answer::bad_request(&mut out, remark);
        Item::Answered(Status::BadRequest, out)
    }

    /// Approximate memory of the line and its answer.
    fn bytes(&self) -> usize {
        match self {
            Item::Answered(_, text) => text.len(),
            Item::Asked(question) => {
                let numbers = question.input.len() + question.numbers.len();
                size_of::<Question>() + size_of::<f64>() * numbers
            }
        }
    }
}

/// True where stdin has bytes to read, or has ended.
fn has_input() -> bool {
    let stdin = io::stdin();
    let mut polled = [PollFd::new(&stdin, PollFlags::IN)];
    // if poll fails, answers do not wait for more lines
    poll(&mut polled, Some(&Timespec::default())).is_ok_and(|ready| ready > 0)
}

/// The query of a line that names its request, and its packed inputs; the error names the fault
/// and its column.
pub(super) fn read_plan(model: &ModelInfo, line: &str) -> Result<(Query, Vec<f64>), String> {
    let words =
        |problem: Problem| format!("{} at column {}", problem.words, column(line, problem.offset));
    let asked = read::read(None, [Tolerance::USUAL; 2], model, line).map_err(words)?;
    let input = packed(&asked, &Layout::of_given(&asked.query, &model.sizes));
    asked.doubt.map_or(Ok((asked.query, input)), |problem| Err(words(problem)))
}

/// The inputs of a line, packed for a plan.
fn packed(asked: &Asked, given: &Layout) -> Vec<f64> {
    let mut input = vec![0.0; given.len()];
    for field in &asked.given {
        let room = given.slot(field.field).and_then(|slot| input.get_mut(slot.range()));
        room.into_iter().flatten().zip(&field.numbers).for_each(|(to, number)| *to = *number);
    }
    input
}

/// The column of a byte, in characters from 1.
fn column(text: &str, offset: usize) -> usize {
    text.char_indices().take_while(|(at, _)| *at < offset).count() + 1
}

/// The reason of a status that its name and the numbers do not tell.
fn reason(status: Status, want: &Layout, numbers: &[f64]) -> Option<&'static str> {
    let binding = want.slot(Field::Binding).and_then(|slot| numbers.get(slot.range()));
    let is_free = binding.is_some_and(|rows| rows.iter().all(|x| *x == 0.0));
    match status {
        // those that are not finite were found before
        Status::NonFiniteInput => Some("finite numbers, so large that the answer would not be"),
        Status::Infeasible if is_free => {
            Some("frames that are held, or freedoms without an actuator, contradict; no limit does")
        }
        _ => None,
    }
}

//! Questions with the answers of a robot in this process.

use fastrand::Rng;
use sarrus_client::{Options, Query, Request, Robot, Source, Status};

use crate::sandbox::words;

/// Request, given and wanted fields of the queries. The last two have equal sizes on robots with as
/// many actuators as coordinates, so that an answer to the other query would fit.
const QUERIES: [(Request, &[&str], &[&str]); 3] = [
    (Request::Kinematics, &["y", "yd"], &["q", "qd", "u"]),
    (Request::InverseDynamics, &["y", "yd", "ydd"], &["tau_u"]),
    (Request::ForwardDynamics, &["y", "yd", "tau_u"], &["ydd"]),
];

/// A question and its answer.
pub(crate) struct Question {
    /// The index of the query.
    pub(crate) query: usize,
    pub(crate) input: Vec<f64>,
    pub(crate) status: u32,
    pub(crate) warnings: u32,
    pub(crate) output: Vec<f64>,
}

/// Questions about a robot.
pub(crate) struct Oracle {
    pub(crate) queries: Vec<Query>,
    pub(crate) questions: Vec<Question>,
}

impl Oracle {
    /// `n` questions about a bundled robot; about every eighth is far beyond its reach.
    pub(crate) fn new(robot: &str, seed: u64, n: usize) -> Result<Oracle, String> {
        let source = Source::Bundled(robot.to_owned());
        let mut robot = Robot::load(&source, &Options::default()).map_err(words)?;
        let mut plans = Vec::new();
        for (request, given, want) in QUERIES {
            let query = robot.query(request).given(given.iter()).want(want.iter());
            plans.push(query.prepare().map_err(words)?);
        }
        let mut random = Rng::with_seed(seed);
        let mut questions = Vec::new();
        for k in 0..n {
            let query = k % plans.len();
            let plan = plans[query];
            let Some(prepared) = robot.plan(plan) else { continue };
            let n_in = prepared.given().len();
            let n_out = prepared.want().len();
            let scale = if random.u8(..8) == 0 { 100.0 } else { 0.3 };
            let mut input: Vec<f64> =
                (0..n_in).map(|_| scale * (2.0 * random.f64() - 1.0)).collect();
            if random.u8(..16) == 0
                && let Some(number) = random.choice(input.iter_mut())
            {
                *number = f64::NAN;
            }
            let mut output = vec![0.0; n_out];
            let answer = robot.ask(plan, &input, &mut output).map_err(words)?;
            let status = answer.status as u32;
            let warnings = answer.warnings.0;
            questions.push(Question { query, input, status, warnings, output });
        }
        let queries = plans.iter().filter_map(|plan| robot.plan(*plan)).map(|one| *one.query());
        Ok(Oracle { queries: queries.collect(), questions })
    }

    /// A question.
    pub(crate) fn any(&self, random: &mut Rng) -> Option<&Question> {
        self.questions.get(random.usize(..self.questions.len().max(1)))
    }
}

impl Question {
    /// True where an answer has the same status, warnings and bits.
    pub(crate) fn is_answered_by(&self, status: u32, warnings: u32, output: &[f64]) -> bool {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
        (self.status, self.warnings) == (status, warnings)
            && self.output.len() == output.len()
            && self.output.iter().zip(output).all(same)
    }
}

/// True of a status without computation: the server or client refused the request.
pub(crate) fn is_refusal(status: u32) -> bool {
    status == Status::Overloaded as u32 || status == Status::ShuttingDown as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_are_answered_by_their_own_bits_only() {
        let oracle = Oracle::new("lambda", 1, 64).unwrap();
        assert_eq!((oracle.queries.len(), oracle.questions.len()), (3, 64));
        let ok = oracle.questions.iter().filter(|question| question.status == 0).count();
        assert!(ok > 16 && ok < 64, "{ok}");
        for question in oracle.questions.iter().filter(|question| question.status == 0) {
            let Question { status, warnings, output, .. } = question;
            assert!(question.is_answered_by(*status, *warnings, output));
            assert!(!question.is_answered_by(status + 1, *warnings, output));
            let mut other = output.clone();
            other[0] = f64::from_bits(other[0].to_bits() ^ 1);
            assert!(!question.is_answered_by(*status, *warnings, &other));
        }
    }
}

//! Random inputs of a plan.

use sarrus_dynamics::{Field, FieldSet, Layout, Model, ModelInfo, Plan, Planned, Query, Request};

/// Part of the range of each coordinate, in turns: far out closures may be out of reach.
const PARTS: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// Part of the way from zero at which a guess stands.
const GUESS: f64 = 0.9;

/// Random inputs of one plan.
#[derive(Debug)]
pub struct RandomInputs<'a> {
    model: &'a Model<f64>,
    given: &'a Layout,
    /// From y, and ẏ, to the closed pose that is a guess.
    guess: Option<Planned>,
}

impl<'a> RandomInputs<'a> {
    /// States of a plan of this model. Allocates.
    pub fn new(model: &'a Model<f64>, plan: &'a Plan) -> RandomInputs<'a> {
        use Field::{Q, QGuess, Qd, QdGuess, Y, Yd};
        let given = plan.given();
        let mut from = vec![Y];
        let mut to = vec![Q];
        if given.slot(QdGuess).is_some() {
            from.push(Yd);
            to.push(Qd);
        }
        let query = Query::new(Request::Kinematics, FieldSet::of(&from), FieldSet::of(&to));
        let guess = given.slot(QGuess).and_then(|_| Planned::new(model, &query).ok());
        RandomInputs { model, given, guess }
    }

    /// Input number `k`: that of [`random_input`], with a closed pose nearby where a guess is
    /// given; no numbers where there is none. Allocates.
    pub fn input(&mut self, k: u64) -> Vec<f64> {
        let info = self.model.info();
        let mut input = random_input(info, self.given, k);
        if let Some(near) = &mut self.guess {
            near.input = random_input(info, near.plan.given(), k);
            if let Some(own) = self.given.slot(Field::Y) {
                let names = input[own.range()].iter().zip(&info.independent_q);
                let part = |name: &String| if name.contains('/') { 1.0 } else { GUESS };
                let y: Vec<f64> = names.map(|(x, name)| x * part(name)).collect();
                near.give(Field::Y, &y);
            }
            let _ = near.run(self.model);
            for (guess, of) in [(Field::QGuess, Field::Q), (Field::QdGuess, Field::Qd)] {
                if let Some(to) = self.given.slot(guess) {
                    input[to.range()].copy_from_slice(near.get(of));
                }
            }
        }
        input
    }
}

/// Input number `k` of a fixed sequence: coordinates in their limits, rates of up to 1 and 5,
/// forces of up to 10, in SI; quaternions of unit length, and zeros for guesses.
pub fn random_input(info: &ModelInfo, given: &Layout, k: u64) -> Vec<f64> {
    let mut random = fastrand::Rng::with_seed(k.wrapping_add(20_261_122));
    let part = PARTS[(k % 4) as usize];
    let mut input = vec![0.0; given.len()];
    for slot in given.slots() {
        for (row, x) in input[slot.range()].iter_mut().enumerate() {
            let unit = 2.0 * random.f64() - 1.0;
            *x = match slot.field {
                Field::Y => {
                    let (lower, upper) = range(info, row);
                    // a part of the range around its number nearest to zero
                    let middle = 0.0_f64.clamp(lower, upper);
                    let far = if unit < 0.0 { lower } else { upper };
                    middle + (far - middle) * part * unit.abs()
                }
                Field::Yd => unit,
                Field::Ydd => 5.0 * unit,
                Field::QGuess | Field::QdGuess => 0.0,
                _ => 10.0 * unit,
            };
        }
        if slot.field == Field::Y {
            normalise_quaternions(info, &mut input[slot.range()]);
        }
    }
    input
}

fn normalise_quaternions(info: &ModelInfo, y: &mut [f64]) {
    let first = |(row, name): (usize, &String)| name.ends_with("/qx").then_some(row);
    for row in info.independent_q.iter().enumerate().filter_map(first) {
        let Some(quaternion) = y.get_mut(row..row + 4) else { return };
        let length = quaternion.iter().fold(0.0, |sum, x| sum + *x * *x).sqrt();
        quaternion.iter_mut().for_each(|x| *x /= length);
    }
}

/// Range of an independent coordinate, at most half a turn or a metre to each side.
fn range(info: &ModelInfo, row: usize) -> (f64, f64) {
    let limits = info.independent_q.get(row).and_then(|name| info.limits_of(name));
    let lower = limits.and_then(|limits| limits.lower).unwrap_or(-3.0).max(-3.0);
    let upper = limits.and_then(|limits| limits.upper).unwrap_or(3.0).min(3.0);
    (lower.min(upper), upper)
}

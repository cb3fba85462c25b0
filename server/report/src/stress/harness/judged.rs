//! Answers judged field by field, against a reference that is compared with itself first.

use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Field, Method, PlanScalar, Request, Status};

use super::assess::HELD;
use super::case::{At, Case, Cases};
use super::question::{Answered, Question, error};
use super::robot::Robot;
use crate::Outcome;

use Field::*;

/// Relative change of the given numbers for a second reference: far more than the rounding of
/// double-double, far less than that of a double.
const CHANGE: f64 = 1.0 / (1_u128 << 80) as f64;
/// Half an ulp of a number just below a power of two.
const ULP: f64 = 0.5 * f64::EPSILON;
/// Largest difference by size of two references that count as exact.
const CERTAIN: f64 = 1e-11;
/// Fraction of its natural size below which a field counts as zero; for fields of the velocity
/// alone, which cancel in many mechanisms; for a link's own motion, which loops may hold still.
const NOTHING: f64 = 1e-6;
const CANCELLED: f64 = 1e-4;
const STILL: f64 = 1e-2;
/// Independents up to which the second reference uses projection.
const PROJECTED: usize = 40;

impl Cases {
    /// Asks, and judges every field of the answer by its own size. A case is counted but not judged
    /// if its double-double reference changes too much under relative changes of 2^−80 in the given
    /// numbers and the other method of forward dynamics.
    pub(crate) fn judge(
        &mut self,
        robot: &Robot,
        at: At<'_>,
        asked: &str,
        ask: &Question,
    ) -> Outcome {
        let answer = ask.run(&robot.compiled.model)?;
        let ok = answer.status() == Status::Ok;
        let mut worst = None;
        let mut reported = String::new();
        if ok {
            let exact = ask.run(&robot.compiled.exact)?;
            if exact.status() == Status::Ok {
                let second = second_reference(robot, ask)?;
                if second.status() != Status::Ok || largest(robot, ask, &second, &exact).1 > CERTAIN
                {
                    self.not_judged += 1;
                    return Ok(());
                }
                let (field, error) = largest(robot, ask, &answer, &exact);
                worst = Some(error);
                if error > HELD {
                    let ulp = moved(robot, ask, &exact)?;
                    let name = field.map_or("", Field::name);
                    reported = format!("{name} off; one ulp of the input moves it by {ulp:.1e}");
                }
            } else {
                reported = format!("double-double: {}", exact.status().name());
            }
        }
        let error = ok.then_some(worst.unwrap_or(f64::INFINITY));
        self.all.push(Case { reported, ..self.answered(robot, at, asked, &answer, error) });
        Ok(())
    }
}

/// A second reference in double-double, from inputs with a relative change of 2^−80; forward
/// dynamics by the other method.
fn second_reference(robot: &Robot, ask: &Question) -> Outcome<Answered<Dd>> {
    let exact = &robot.compiled.exact;
    let other = match ask.method.unwrap_or_else(|| exact.forward_method()) {
        Method::Recursion if exact.sizes().n_vy <= PROJECTED => Method::Projection,
        _ => Method::Recursion,
    };
    let method = (ask.request == Request::ForwardDynamics).then_some(other);
    nudged(robot, &Question { method, ..ask.clone() }, CHANGE)
}

/// The answer in double-double to inputs with this relative change, alternately up and down.
fn nudged(robot: &Robot, ask: &Question, size: f64) -> Outcome<Answered<Dd>> {
    ask.run_with(&robot.compiled.exact, &|k, x| {
        let sign = if k % 2 == 0 { size } else { -size };
        Dd::from(x) + Dd::from(x * sign)
    })
}

/// The change of the exact answer under input errors of up to half an ulp, which no computation in
/// doubles can avoid.
fn moved(robot: &Robot, ask: &Question, exact: &Answered<Dd>) -> Outcome<f64> {
    let near = nudged(robot, ask, ULP)?;
    let ok = near.status() == Status::Ok;
    Ok(if ok { largest(robot, ask, &near, exact).1 } else { f64::INFINITY })
}

/// The field of the largest error by its size, and that error.
fn largest<T: PlanScalar>(
    robot: &Robot,
    ask: &Question,
    answer: &Answered<T>,
    exact: &Answered<Dd>,
) -> (Option<Field>, f64) {
    ask.want
        .iter()
        .map(|&field| {
            let least = natural(ask, field);
            (Some(field), error(robot, field, answer.get(field), exact.get(field), least))
        })
        .fold((None, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst })
}

/// The size below which a field counts as zero, from a radian, the given speed, its square and the
/// acceleration.
fn natural(ask: &Question, field: Field) -> f64 {
    let given = |of: &[Field]| {
        ask.given
            .iter()
            .filter(|(field, _)| of.contains(field))
            .flat_map(|(_, numbers)| numbers)
            .fold(0.0, |size: f64, x| size.max(x.abs()))
    };
    let speed = given(&[Yd, Qd, Ud]);
    let acceleration = (speed * speed).max(given(&[Ydd, Qdd, Udd]));
    match field {
        // a position of a tenth of a milliradian has the size of its joint's error
        Q | U | Y => 1e-4,
        G | GU | K | JacobianTree => NOTHING,
        Qd | Ud => NOTHING * speed,
        Qdd | Udd => NOTHING * acceleration,
        GBias | GUBias | KBias => CANCELLED * speed * speed,
        JacobianIndependent => STILL,
        FrameTwist => STILL * speed,
        FrameAcc => STILL * acceleration,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use sarrus_dynamics::description::SubmechanismKind as Kind;

    use super::*;
    use crate::stress::harness::question::State;
    use crate::stress::mechanisms::{LOOSE, four_bar};

    #[test]
    fn two_references_agree_and_one_of_another_input_does_not() {
        let of = four_bar(LOOSE, Kind::Numerical, "xyz").expect("bars");
        let robot = Robot::new("four-bar", of).expect("a model");
        let state = State::of(&robot, 0.2).expect("a state");
        let ask = Question::forward(&state, None);
        let exact = ask.run(&robot.compiled.exact).expect("a plan");
        let second = second_reference(&robot, &ask).expect("a plan");
        let apart = largest(&robot, &ask, &second, &exact).1;
        assert!(apart > 0.0 && apart < 1e-20, "{apart}");
        let other = ask.run_with(&robot.compiled.exact, &|_, x| Dd::from(x) + Dd::from(1e-9 * x));
        assert!(largest(&robot, &ask, &other.expect("a plan"), &exact).1 > CERTAIN);
    }
}

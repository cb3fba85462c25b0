//! Two ways to one number: closed form and Newton's method, double and double-double.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Compiled, Field, FieldSet, Model, PlanScalar, Query, Request};
use sarrus_models::{Options, bundled_text};
use sarrus_tests::cases::{Case, Ledger, SEEDS, State, robots};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::random::{Text, random_robot, random_robot_numerical};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;

use Field::*;

/// Answers of one model at a state: kinematics with frames, inverse dynamics, and forward dynamics
/// with random actuator forces.
fn answers<T: PlanScalar>(
    model: &Model<T>,
    state: &State<T>,
    links: &[u16],
    with_actuators: bool,
) -> [Fields<T>; 3] {
    let mut robot = Robot::new(model.clone());
    let motion: [(Field, &[T]); 3] = [(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)];
    let of = |request, want: &[Field]| Query::new(request, FieldSet::EMPTY, FieldSet::of(want));
    let mut want = STATE.to_vec();
    if with_actuators {
        want.push(JacobianActuator);
    }
    let kinematics = robot.ask_for(of(Request::Kinematics, &want).with_frames(links), &motion).ok();
    let inverse = robot.ask(Request::InverseDynamics, &motion, &INVERSE).ok();
    let tau = Seeded::new(3).numbers(model.sizes().n_u, largest(inverse.get(TauY)));
    let tau: Vec<T> = tau.into_iter().map(T::from_f64).collect();
    let forward =
        robot.ask(Request::ForwardDynamics, &[motion[0], motion[1], (TauU, &tau)], &FORWARD).ok();
    [kinematics, inverse, forward]
}

const STATE: [Field; 22] = [
    Q,
    Qd,
    Qdd,
    U,
    Ud,
    Udd,
    G,
    GBias,
    GU,
    GUBias,
    FramePose,
    FrameTwist,
    FrameAcc,
    JacobianTree,
    JacobianIndependent,
    CondKd,
    CondGu,
    SigmaMin,
    K,
    KBias,
    Residual,
    Iterations,
];
const INVERSE: [Field; 8] = [TauQ, TauY, TauU, TauUnactuated, Lambda, MY, CY, CondMy];
const FORWARD: [Field; 7] = [Ydd, Qdd, TauY, MY, CY, CondMy, Lambda];

/// Condition numbers and sizes of a state, from the more exact answer.
struct Scale {
    K_d: f64,
    G_u: f64,
    M_y: f64,
    velocity: f64,
    force: f64,
    /// Size of the accelerations that the state's forces can cause.
    acceleration: f64,
}

impl Scale {
    fn of<T: PlanScalar>([state, inverse, forward]: &[Fields<T>; 3]) -> Scale {
        let figure = |fields: &Fields<T>, field| fields.get(field)[0].to_f64();
        let force =
            largest(inverse.get(TauQ)).max(largest(inverse.get(MY)) * largest(forward.get(Ydd)));
        Scale {
            K_d: figure(state, CondKd),
            G_u: figure(state, CondGu),
            M_y: figure(inverse, CondMy),
            velocity: largest(state.get(Qd)),
            force,
            acceleration: largest(forward.get(Qdd)).max(force / largest(inverse.get(MY))),
        }
    }

    /// Least size of a field's error, and the condition number that multiplies it.
    fn of_field(&self, field: Field, K_size: f64) -> (f64, f64) {
        let square = self.velocity.powi(2);
        match field {
            Q | U | G | GU | K | FramePose | JacobianTree | JacobianIndependent | Residual
            | SigmaMin => (1.0, self.K_d),
            Qd | Ud | FrameTwist => (self.velocity, self.K_d),
            GBias | GUBias => (square, self.K_d * self.K_d),
            KBias => (K_size * square, self.K_d),
            Qdd | Udd | FrameAcc => (square, self.K_d * self.K_d),
            JacobianActuator => (1.0, self.K_d * self.G_u),
            TauQ | TauY | CY => (self.force, self.K_d * self.K_d),
            TauU | TauUnactuated => (self.force, self.K_d * self.K_d * self.G_u),
            Lambda => (self.force, self.K_d * self.K_d * self.G_u),
            MY => (0.0, self.K_d),
            CondKd | CondGu | CondMy => (0.0, self.K_d * self.G_u * self.M_y),
            _ => (1.0, self.K_d),
        }
    }
}

/// Compares every field; `share` is the bound at condition 1.
fn compare<T: PlanScalar>(
    ledger: &mut Ledger,
    case: &Case,
    what: &str,
    (mine, reference): (&[Fields<T>; 3], &[Fields<T>; 3]),
    skip: &[Field],
    share: f64,
) {
    let scale = Scale::of(reference);
    let K_size = largest(reference[0].get(K));
    let parts: [(&[Field], bool); 3] = [(&STATE, false), (&INVERSE, false), (&FORWARD, true)];
    for (part, (fields, forward)) in parts.into_iter().enumerate() {
        for field in fields.iter().filter(|field| !skip.contains(field)) {
            let (mut least, mut condition) = scale.of_field(*field, K_size);
            if forward && matches!(field, Ydd | Qdd) {
                (least, condition) = (scale.acceleration, scale.K_d * scale.K_d * scale.M_y);
            }
            let error = error_by_size(mine[part].get(*field), reference[part].get(*field), least);
            ledger.note(&format!("{what} {}", field.name()), case, error, share * condition);
        }
    }
}

/// Some links of a model.
fn some_links<T>(model: &Model<T>, seed: u64) -> Vec<u16> {
    let mut seeded = Seeded::new(seed);
    (0..6).map(|_| seeded.below(model.link_names().len()) as u16).collect()
}

#[test]
fn double_agrees_with_double_double_in_every_output() {
    Ledger::over(robots(), |case, ledger| {
        let Compiled { model, exact, .. } = &case.compiled;
        let links = some_links(model, case.seed);
        for k in 0..2 {
            let with_actuators = case.square && !case.floats();
            let mine = answers(model, &case.state(k), &links, with_actuators);
            let reference = answers::<Dd>(exact, &case.state(k), &links, with_actuators);
            let rounded: [Fields<Dd>; 3] = mine.map(|fields| fields.map(Dd::from));
            compare(ledger, case, "", (&rounded, &reference), &[Iterations], 64.0 * f64::EPSILON);
        }
    });
}

/// Compares both ways to close a robot's mechanisms, in both scalars.
fn both_ways(ledger: &mut Ledger, a: &Case, b: &Case) {
    // each type has its own rows, and with them λ, K, k and condition numbers
    let skip = [K, KBias, Lambda, CondKd, SigmaMin, Residual, Iterations];
    let links = some_links(&a.compiled.model, a.seed);
    for k in 0..3 {
        let [mine, other] = [a, b].map(|x| answers(&x.compiled.model, &a.state(k), &links, false));
        compare(
            ledger,
            a,
            "double",
            (&mine, &other),
            &skip,
            64.0 * f64::EPSILON + a.contradiction(),
        );
        let [mine, other] =
            [a, b].map(|x| answers::<Dd>(&x.compiled.exact, &a.state(k), &links, false));
        compare(
            ledger,
            a,
            "double-double",
            (&mine, &other),
            &skip,
            64.0 * <Dd as Real>::EPSILON + a.contradiction(),
        );
    }
}

#[test]
fn closed_forms_agree_with_newtons_method() {
    let mut pairs = Vec::new();
    for seed in 0..2 * SEEDS {
        if let Some(numerical) = random_robot_numerical(seed) {
            let text = random_robot(seed);
            // a rounded cut frame differs from the position that the type defines
            let same = !(text.rounded
                && (text.holds.contains("by type") || text.holds.contains("legs on arms")));
            let [a, b] = [&text, &numerical]
                .map(|text| Case::of_text(text, seed, &Options::default()).unwrap());
            // a mechanism coupled to another one becomes part of a larger one without a closed form
            let kinds = |case: &Case| {
                case.compiled.model.closures().iter().map(|x| x.kind).collect::<Vec<_>>()
            };
            if same && kinds(&a) != kinds(&b) {
                pairs.push((a, b));
            }
        }
    }
    for name in ["lambda", "torso", "r3_lambda_r", "stewart", "rh5v2_upper_body", "rh5v2_full"] {
        let (urdf, yaml) = bundled_text(name).unwrap();
        let yaml = ["RRPR", "2SPU+1U", "6UPS"].iter().fold(yaml.to_owned(), |text, kind| {
            text.replace(&format!("type: {kind}"), "type: NUMERICAL")
        });
        let a = Case::bundled(name);
        let model = Text::of(urdf, &yaml)
            .load(&Options::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let b = Case {
            compiled: model.compiled,
            description: model.description,
            ..Case::bundled(name)
        };
        pairs.push((a, b));
    }
    println!("{} robots", pairs.len());
    Ledger::over(pairs.iter().map(|pair| &pair.0), |a, ledger| {
        let b = &pairs.iter().find(|pair| std::ptr::eq(&pair.0, a)).unwrap().1;
        both_ways(ledger, a, b);
    });
}

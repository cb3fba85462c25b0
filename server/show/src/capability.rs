//! Maps of the capability of the motors at the joints: force, speed, inertia of the rotors and
//! distance to singular poses over a grid of independents.

use std::fmt::Write as _;
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use sarrus_dynamics::description::JointKind;
use sarrus_dynamics::{Field, FieldSet, Model, ModelInfo, Plan, Query, Request, Status, Workspace};
use sarrus_models::{Loaded, matching_joints};
use serde_json::{Map, Value, json};

use crate::{HEAD, embedded, text};

/// Most points of one map.
pub const MOST_POINTS: usize = 1_000_000;
/// Most points of a map whose grid is not given, and most of them along one coordinate.
const USUAL_POINTS: usize = 20_000;
const USUAL_SIDE: usize = 101;
/// Points that a thread takes at once.
const PORTION: usize = 64;

/// Choices of the maps.
#[derive(Clone, Debug, Default)]
pub struct Choices {
    /// Names or patterns of independent joints; without any each submechanism by itself.
    pub joints: Vec<String>,
    /// Points along each coordinate.
    pub grid: Option<usize>,
    /// All independents, for those that the map does not move; zero without it.
    pub at: Option<Vec<f64>>,
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CapabilityError {
    /// No independent joint of one freedom has such a name.
    #[error("`{0}` matches no independent joint of one freedom, expected some of {1}")]
    NoJoint(String, String),
    /// The grid has too many points.
    #[error("{0} points, expected at most {MOST_POINTS}; take fewer joints or a smaller --grid")]
    TooManyPoints(usize),
    /// A grid needs two points at least.
    #[error("a grid of {0} points along a coordinate, expected 2 or more")]
    TooFew(usize),
    /// The independents of `at` are not as many as those of the robot.
    #[error("{found} independents to stand at, expected {expected}")]
    WrongPose {
        /// How many there are.
        found: usize,
        /// How many the robot has.
        expected: usize,
    },
    /// A query that has no plan.
    #[error("{0}")]
    Query(#[from] sarrus_dynamics::QueryError),
}

/// The map of one submechanism, or of chosen joints.
#[derive(Clone, Debug)]
pub struct Capability {
    /// Its name.
    pub name: String,
    /// The joints, and the motors whose positions are in `u`.
    pub joints: Vec<String>,
    /// See `joints`.
    pub motors: Vec<String>,
    /// Points along each joint, and its least and greatest position.
    pub sizes: Vec<usize>,
    /// See `sizes`.
    pub ranges: Vec<[f64; 2]>,
    /// Motors without a limit of force or speed: where they act the numbers are NaN.
    pub no_limit: Vec<String>,
    /// Corners of the ranges that the mechanism does not reach.
    pub unreachable_corners: Vec<Vec<f64>>,
    /// Columns of `rows`: name, and numbers in one point.
    pub columns: Vec<(&'static str, usize)>,
    /// One row a point, the last coordinate fastest; NaN where there is no pose.
    pub rows: Vec<f64>,
}

/// A joint of a map by its places in y, ẏ and q̇.
#[derive(Clone, Copy)]
struct Place {
    y: usize,
    vy: usize,
    v: u16,
}

/// The maps of a robot, on all processors; `progress` gets the part that is done. Allocates.
///
/// # Errors
/// [`CapabilityError`].
pub fn capability(
    loaded: &Loaded,
    choices: &Choices,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Capability>, CapabilityError> {
    let model = &loaded.compiled.model;
    let info = model.info();
    let mut y: Vec<f64> = info.independent_q.iter().map(|name| rest(name)).collect();
    if let Some(at) = &choices.at {
        if at.len() != y.len() {
            return Err(CapabilityError::WrongPose { found: at.len(), expected: y.len() });
        }
        y.copy_from_slice(at);
    }
    let groups = groups(loaded, choices)?;
    let mut maps = Vec::new();
    for (k, (name, joints)) in groups.iter().enumerate() {
        let mut part = |done: f64| progress((k as f64 + done) / groups.len() as f64);
        maps.push(map(loaded, name, joints, choices.grid, &y, &mut part)?);
    }
    Ok(maps)
}

/// A coordinate at rest.
fn rest(name: &str) -> f64 {
    if name.ends_with("/qw") { 1.0 } else { 0.0 }
}

/// Each map's name and joints.
fn groups(
    loaded: &Loaded,
    choices: &Choices,
) -> Result<Vec<(String, Vec<String>)>, CapabilityError> {
    let info = loaded.compiled.model.info();
    // joints of one freedom have one name in all orders
    let is_single = |name: &&String| info.tree.contains(name) && info.independent.contains(name);
    if choices.joints.is_empty() {
        let joints = &loaded.description.joints;
        let of = |independent: &[usize]| -> Vec<String> {
            let names = independent.iter().filter_map(|j| Some(&joints.get(*j)?.name));
            names.filter(is_single).cloned().collect()
        };
        let groups = loaded.description.submechanisms.iter();
        let groups = groups.map(|group| (group.name.clone(), of(&group.independent)));
        return Ok(groups.filter(|(_, joints)| !joints.is_empty()).collect());
    }
    let mut picked = Vec::new();
    for pattern in &choices.joints {
        let found = matching_joints(info, pattern);
        let names = found.iter().filter_map(|v| info.tree.get(usize::from(*v)));
        let names: Vec<&String> = names.filter(is_single).collect();
        if names.is_empty() {
            let known: Vec<&str> =
                info.independent.iter().filter(is_single).map(String::as_str).collect();
            return Err(CapabilityError::NoJoint(pattern.clone(), known.join(", ")));
        }
        picked.extend(names.into_iter().filter(|name| !picked.contains(name)).collect::<Vec<_>>());
    }
    let names: Vec<String> =
        info.independent.iter().filter(|x| picked.contains(x)).cloned().collect();
    Ok(vec![(info.robot.clone(), names)])
}

fn map(
    loaded: &Loaded,
    name: &str,
    joints: &[String],
    grid: Option<usize>,
    y: &[f64],
    progress: &mut dyn FnMut(f64),
) -> Result<Capability, CapabilityError> {
    let model = &loaded.compiled.model;
    let info = model.info();
    let at = |names: &[String], joint: &String| names.iter().position(|x| x == joint).unwrap_or(0);
    let places: Vec<Place> = joints
        .iter()
        .map(|joint| Place {
            y: at(&info.independent_q, joint),
            vy: at(&info.independent, joint),
            v: at(&info.tree, joint) as u16,
        })
        .collect();
    let p = places.len();
    let side = match grid {
        Some(side) if side < 2 => return Err(CapabilityError::TooFew(side)),
        Some(side) => side,
        None => (2..=USUAL_SIDE)
            .rev()
            .find(|side| side.saturating_pow(p as u32) <= USUAL_POINTS)
            .unwrap_or(2),
    };
    let count = side.saturating_pow(p as u32);
    if count > MOST_POINTS {
        return Err(CapabilityError::TooManyPoints(count));
    }
    let ranges: Vec<[f64; 2]> = joints.iter().map(|joint| range(loaded, joint)).collect();
    let asked = Asked::new(model, &places)?;
    let points = |k: usize| {
        let mut rest = k;
        let mut y = y.to_vec();
        for (place, [lower, upper]) in places.iter().zip(&ranges).rev() {
            let part = (rest % side) as f64 / (side - 1) as f64;
            y[place.y] = lower + (upper - lower) * part;
            rest /= side;
        }
        y
    };

    let width = asked.width();
    let rows = computed(model, &asked, count, &points, progress);
    let reachable = asked.column("reachable");
    let corner = |k: usize| {
        let ends = (0..p).map(|i| if k >> (p - 1 - i) & 1 == 1 { side - 1 } else { 0 });
        ends.fold(0, |at, end| at * side + end)
    };
    let corners = (0..1_usize << p.min(10)).map(corner);
    let unreachable = corners.filter(|at| rows[at * width + reachable] == 0.0);
    let unreachable_corners =
        unreachable.map(|at| rows[at * width..at * width + p].to_vec()).collect();
    Ok(Capability {
        name: name.to_owned(),
        joints: joints.to_vec(),
        motors: asked.motors.iter().map(|u| info.active[*u].clone()).collect(),
        sizes: vec![side; p],
        ranges,
        no_limit: asked.no_limit(info),
        unreachable_corners,
        columns: asked.columns.clone(),
        rows,
    })
}

/// The rows of all points: threads take portions of them, this one shows the progress.
fn computed(
    model: &Model,
    asked: &Asked,
    count: usize,
    points: &(impl Fn(usize) -> Vec<f64> + Sync),
    progress: &mut dyn FnMut(f64),
) -> Vec<f64> {
    let width = asked.width();
    let mut rows = vec![f64::NAN; count * width];
    let done = AtomicUsize::new(0);
    let portions: Vec<_> = rows.chunks_mut(PORTION * width).enumerate().collect();
    let queue = std::sync::Mutex::new(portions.into_iter());
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let mut workspace = Workspace::new(model);
                loop {
                    let next = queue.lock().ok().and_then(|mut queue| queue.next());
                    let Some((portion, rows)) = next else { break };
                    for (k, row) in rows.chunks_mut(width).enumerate() {
                        let y = points(portion * PORTION + k);
                        asked.point(model, &mut workspace, &y, row);
                    }
                    done.fetch_add(rows.len() / width, Ordering::Relaxed);
                }
            });
        }
        while done.load(Ordering::Relaxed) < count {
            progress(done.load(Ordering::Relaxed) as f64 / count as f64);
            thread::sleep(Duration::from_millis(2));
        }
    });
    rows
}

/// The range of a joint: its limits, or a turn, or a tenth of a metre to both sides.
fn range(loaded: &Loaded, joint: &str) -> [f64; 2] {
    let joint = loaded.description.joints.iter().find(|x| x.name == joint);
    let usual = match joint.map(|joint| joint.kind) {
        Some(JointKind::Prismatic) => 0.1,
        _ => std::f64::consts::PI,
    };
    let limits = joint.and_then(|joint| joint.limits).map(|limits| limits.finite());
    let lower = limits.and_then(|limits| limits.lower);
    let upper = limits.and_then(|limits| limits.upper);
    let lower = lower.unwrap_or_else(|| upper.map_or(-usual, |upper| upper - 2.0 * usual));
    [lower, upper.unwrap_or(lower + 2.0 * usual)]
}

/// The plans of a map.
struct Asked {
    places: Vec<Place>,
    /// Motors that act on the joints, as places in u.
    motors: Vec<usize>,
    /// Largest speeds of all motors; NaN without one.
    speeds: Vec<f64>,
    columns: Vec<(&'static str, usize)>,
    state: Plan,
    margin: Plan,
    vertices: Option<Plan>,
    /// Of each joint, the others free.
    speed: Vec<Option<Plan>>,
}

impl Asked {
    fn new(model: &Model, places: &[Place]) -> Result<Asked, CapabilityError> {
        use Field::*;
        let info = model.info();
        let p = places.len();
        let velocities = || {
            let mut all: Vec<u16> = places.iter().map(|place| place.v).collect();
            all.sort_unstable();
            all
        };
        let given = FieldSet::of(&[Y]);
        let query = |want: &[Field]| Query::new(Request::Kinematics, given, FieldSet::of(want));
        let state = query(&[U, GU, TorqueSupport, ReflectedInertia, SigmaMin]);
        let state = Plan::new(model, &state.with_directions(2 * p))?;
        let margin = Query::new(Request::Map, given.with(TauY), FieldSet::of(&[Margin]));
        let margin = Plan::new(model, &margin.with_joints(velocities()))?;
        let vertices = match p {
            2 => Some(Plan::new(model, &query(&[TorqueVertices]).with_joints(velocities()))?),
            _ => None,
        };
        // none where a mechanism has more motors than freedoms
        let alone =
            |place: &Place| Plan::new(model, &query(&[SpeedVertices]).with_joints([place.v])).ok();
        let speed = places.iter().map(alone).collect();
        // an actuator acts on the joints of its cluster
        let clusters = model.independent_clusters();
        let own: Vec<usize> = places.iter().map(|place| clusters[place.vy]).collect();
        let of_motors = model.actuator_clusters();
        let motors: Vec<usize> =
            (0..info.active.len()).filter(|u| own.contains(&of_motors[*u])).collect();
        let limit = |name: &String| info.limits_of(name)?.velocity.filter(|speed| *speed > 0.0);
        let speeds = info.active.iter().map(|name| limit(name).unwrap_or(f64::NAN)).collect();
        let mut columns = vec![
            ("points", p),
            ("torque_max", p),
            ("torque_min", p),
            ("torque_alone", p),
            ("speed_max", p),
            ("speed_free", p),
            ("reflected_inertia", p * p),
            ("sigma_min", 1),
            ("reachable", 1),
            ("u", motors.len()),
        ];
        columns.extend(vertices.as_ref().map(|plan| ("torque_vertices", plan.want().len())));
        Ok(Asked {
            places: places.to_vec(),
            motors,
            speeds,
            columns,
            state,
            margin,
            vertices,
            speed,
        })
    }

    fn width(&self) -> usize {
        self.columns.iter().map(|(_, width)| width).sum()
    }

    /// The place of a column in a row.
    fn column(&self, name: &str) -> usize {
        self.columns.iter().take_while(|(known, _)| *known != name).map(|(_, width)| width).sum()
    }

    /// Motors of the map without a limit of force or of speed.
    fn no_limit(&self, info: &ModelInfo) -> Vec<String> {
        let names = self.motors.iter().filter_map(|u| info.active.get(*u));
        let is_limited = |name: &&String| {
            let has = |limit: Option<f64>| limit.is_some_and(|limit| limit > 0.0);
            info.limits_of(name).is_some_and(|limits| has(limits.effort) && has(limits.velocity))
        };
        names.filter(|name| !is_limited(name)).cloned().collect()
    }

    /// The row of one point.
    fn point(&self, model: &Model, workspace: &mut Workspace<f64>, y: &[f64], row: &mut [f64]) {
        let p = self.places.len();
        let n = model.sizes().n_vy;
        let mut ask = |plan: &Plan, given: &[(Field, &[f64])]| {
            let mut input = vec![0.0; plan.given().len()];
            for (field, numbers) in given {
                let range = plan.given().slot(*field).map_or(0..0, |slot| slot.range());
                input[range].copy_from_slice(numbers);
            }
            let mut output = vec![f64::NAN; plan.want().len()];
            let answer = plan.run(model, workspace, &input, &mut output);
            (answer.status == Status::Ok, output)
        };
        let mut put = |name: &str, k: usize, x: f64| row[self.column(name) + k] = x;
        for (k, place) in self.places.iter().enumerate() {
            put("points", k, y[place.y]);
        }
        let mut directions = vec![0.0; 2 * p * n];
        for (k, place) in self.places.iter().enumerate() {
            directions[2 * k * n + place.vy] = 1.0;
            directions[(2 * k + 1) * n + place.vy] = -1.0;
        }
        let (is_reachable, x) =
            ask(&self.state, &[(Field::Y, y), (Field::Directions, &directions)]);
        put("reachable", 0, f64::from(u8::from(is_reachable)));
        if !is_reachable {
            return;
        }
        let get = |field| &x[self.state.want().slot(field).map_or(0..0, |slot| slot.range())];
        put("sigma_min", 0, get(Field::SigmaMin)[0]);
        self.motors.iter().enumerate().for_each(|(k, u)| put("u", k, get(Field::U)[*u]));
        let jacobian = get(Field::GU);
        for (k, place) in self.places.iter().enumerate() {
            put("torque_max", k, get(Field::TorqueSupport)[2 * k]);
            put("torque_min", k, -get(Field::TorqueSupport)[2 * k + 1]);
            let speeds = self.motors.iter().map(|u| (self.speeds[*u], jacobian[u * n + place.vy]));
            let most = speeds.fold(f64::INFINITY, |most, (speed, g)| match g {
                0.0 => most,
                g if (speed / g).is_nan() || most.is_nan() => f64::NAN,
                g => most.min(speed / g.abs()),
            });
            put("speed_max", k, if most.is_finite() { most } else { f64::NAN });
            for (l, other) in self.places.iter().enumerate() {
                let at = place.vy * n + other.vy;
                put("reflected_inertia", k * p + l, get(Field::ReflectedInertia)[at]);
            }
            let mut tau = vec![0.0; n];
            let mut alone = f64::INFINITY;
            for sign in [1.0, -1.0] {
                tau[place.vy] = sign;
                let margin = ask(&self.margin, &[(Field::Y, y), (Field::TauY, &tau)]).1;
                alone = if margin[0].is_nan() { f64::NAN } else { alone.min(margin[0]) };
            }
            put("torque_alone", k, alone);
            if let Some(plan) = &self.speed[k] {
                let free = ask(plan, &[(Field::Y, y)]).1;
                put("speed_free", k, free.iter().fold(f64::NAN, |most, x| most.max(*x)));
            }
        }
        if let Some(plan) = &self.vertices {
            let vertices = ask(plan, &[(Field::Y, y)]).1;
            vertices.iter().enumerate().for_each(|(k, x)| put("torque_vertices", k, *x));
        }
    }
}

impl Capability {
    /// The columns by name, one entry a point.
    pub fn to_json(&self) -> Value {
        let p = self.joints.len();
        let width: usize = self.columns.iter().map(|(_, width)| width).sum();
        let mut from = 0;
        let mut all = Map::new();
        let head = json!({
            "submechanism": self.name, "joints": self.joints, "motors": self.motors,
            "sizes": self.sizes, "ranges": self.ranges, "no_limit": self.no_limit,
            "unreachable_corners": self.unreachable_corners,
        });
        all.extend(head.as_object().cloned().unwrap_or_default());
        for (name, n) in &self.columns {
            let parts = self.rows.chunks_exact(width).map(|row| &row[from..from + n]);
            let entry = |numbers: &[f64]| match *name {
                "reachable" => json!(numbers[0] == 1.0),
                "sigma_min" => json!(numbers[0]),
                "reflected_inertia" => numbers.chunks(p.max(1)).collect(),
                "torque_vertices" => {
                    let is_there = |row: &&[f64]| !row[0].is_nan();
                    numbers.chunks(p.max(1)).filter(is_there).collect()
                }
                _ => json!(numbers),
            };
            all.insert((*name).to_owned(), parts.map(entry).collect());
            from += n;
        }
        Value::Object(all)
    }

    /// A header and one line a point; a cell without a number is empty.
    pub fn to_csv(&self) -> String {
        let p = self.joints.len();
        let mut names = Vec::new();
        for (name, n) in &self.columns {
            for k in 0..*n {
                names.push(match *name {
                    "points" => self.joints[k].clone(),
                    "u" => format!("u/{}", self.motors[k]),
                    "sigma_min" | "reachable" => (*name).to_owned(),
                    "reflected_inertia" => {
                        format!("{name}/{}/{}", self.joints[k / p], self.joints[k % p])
                    }
                    "torque_vertices" => format!("{name}/{}/{}", k / p, self.joints[k % p]),
                    _ => format!("{name}/{}", self.joints[k]),
                });
            }
        }
        let quoted = |name: &String| match name.contains([',', '"', '\n']) {
            true => format!("\"{}\"", name.replace('"', "\"\"")),
            false => name.clone(),
        };
        let mut text = names.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n";
        for row in self.rows.chunks_exact(names.len()) {
            for (k, x) in row.iter().enumerate() {
                let stroke = if k > 0 { "," } else { "" };
                let _ =
                    if x.is_nan() { write!(text, "{stroke}") } else { write!(text, "{stroke}{x}") };
            }
            text.push('\n');
        }
        text
    }
}

/// The maps as one page that refers to nothing outside. Allocates.
pub fn capability_page(robot: &str, maps: &[Capability]) -> String {
    let maps: Value = maps.iter().map(Capability::to_json).collect();
    let scripts = format!(
        "<script>const maps = {};</script>\n<script>{}</script>\n",
        embedded(&maps.to_string()),
        include_str!("../page/capability.js")
    );
    include_str!("../page/capability.html")
        .replace("@HEAD@", HEAD)
        .replace("@STYLE@", include_str!("../page/page.css"))
        .replace("@TITLE@", &text(robot))
        .replace("@SCRIPTS@", &scripts)
}

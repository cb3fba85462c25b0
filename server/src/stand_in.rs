//! Stands where `sarrus-dynamics` will stand: the same names, echoing numbers.
#![allow(missing_docs)]

use sarrus_proto::{Layout, Sizes, Status, Wanted, WantedError, Warnings};

pub struct Model {
    pub sizes: Sizes,
    pub n_links: usize,
    pub fingerprint: u64,
}
impl Model {
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }
}
pub struct Workspace;
impl Workspace {
    pub fn new(_: &Model) -> Self {
        Workspace
    }
}
pub struct Answer {
    pub status: Status,
    pub warnings: Warnings,
}
pub struct Plan {
    given: Layout,
    want: Layout,
    wanted: Wanted,
}
impl Plan {
    pub fn new(model: &Model, wanted: &Wanted) -> Result<Plan, WantedError> {
        wanted.check(model.n_links)?;
        Ok(Plan { given: Layout::of_given(wanted, &model.sizes), want: Layout::of_want(wanted, &model.sizes), wanted: *wanted })
    }
    pub fn given(&self) -> &Layout {
        &self.given
    }
    pub fn want(&self) -> &Layout {
        &self.want
    }
    pub fn wanted(&self) -> &Wanted {
        &self.wanted
    }
    pub fn run(&self, _: &Model, _: &mut Workspace, input: &[f64], output: &mut [f64]) -> Answer {
        if input.iter().any(|x| !x.is_finite()) {
            output.fill(f64::NAN);
            return Answer { status: Status::NonFiniteInput, warnings: Warnings::NONE };
        }
        for (k, y) in output.iter_mut().enumerate() {
            *y = input.get(k % input.len().max(1)).copied().unwrap_or(0.0) + (k / input.len().max(1)) as f64;
        }
        Answer { status: Status::Ok, warnings: Warnings::NONE }
    }
}
pub fn robot() -> (Model, sarrus_proto::ModelInfo) {
    let sizes = Sizes { n_q: 23, n_v: 23, n_qy: 13, n_vy: 13, n_u: 13, n_c: 10 };
    let names = |p: &str, n: usize| (0..n).map(|k| format!("{p}{k}")).collect::<Vec<_>>();
    let info = sarrus_proto::ModelInfo {
        robot: "echo".into(),
        fingerprint: 0x1234_5678_9abc_def0,
        sizes: sizes.into(),
        tree: names("q", 23),
        tree_q: names("q", 23),
        independent: names("y", 13),
        independent_q: names("y", 13),
        active: names("u", 13),
        loops: names("l", 10),
        links: names("link", 400),
        ..Default::default()
    };
    (Model { sizes, n_links: 400, fingerprint: info.fingerprint }, info)
}

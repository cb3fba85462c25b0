#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
use sarrus_dynamics::{Field::*, Request};
use sarrus_models::{Options, Source, load};
use sarrus_tests::run::Robot;
use std::collections::BTreeMap;
fn noise(k: u64) -> f64 {
    let x = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 31).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = x ^ x >> 29;
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
fn main() {
    for name in ["lambda", "torso", "ankle", "wrist", "stewart", "parallelogram", "rh5v2_upper_body"] {
        let (urdf, yml) = sarrus_models::bundled_text(name).unwrap();
        let yn = yml
            .replace("type: RRPR", "type: NUMERICAL")
            .replace("type: 2SPU+1U", "type: NUMERICAL")
            .replace("type: 6UPS", "type: NUMERICAL");
        let mut a = Robot::new(load(&Source::Bundled(name.into()), &Options::default()).unwrap().compiled.model);
        let mut n = Robot::new(
            load(&Source::Text { urdf: urdf.into(), submechanisms: Some(yn.into()) }, &Options::default()).unwrap().compiled.model,
        );
        for range in [0.3, 0.8, 1.5, 3.0] {
            let mut counts: BTreeMap<String, usize> = BTreeMap::new();
            let (mut worst, mut its, mut maxit, mut res) = (0.0f64, 0.0, 0.0f64, 0.0f64);
            let t = std::time::Instant::now();
            for k in 0..2000u64 {
                let y: Vec<f64> = (0..a.model.sizes().n_qy)
                    .map(|i| range * noise(k * 97 + i as u64) * if name == "stewart" && i < 3 { 0.2 } else { 1.0 })
                    .collect();
                let x = a.ask(Request::Kinematics, &[(Y, &y)], &[Q, Residual]);
                let z = n.ask(Request::Kinematics, &[(Y, &y)], &[Q, Iterations, Residual, CondKd]);
                *counts.entry(format!("{}/{}", x.answer.status, z.answer.status)).or_default() += 1;
                its += z.get(Iterations)[0];
                maxit = maxit.max(z.get(Iterations)[0]);
                if z.answer.status as u32 == 0 {
                    res = res.max(z.get(Residual)[0]);
                }
                if x.answer.status as u32 == 0 && z.answer.status as u32 == 0 {
                    let e = x
                        .get(Q)
                        .iter()
                        .zip(z.get(Q))
                        .map(|(a, b)| {
                            let d = (a - b).abs();
                            d.min((d - std::f64::consts::TAU).abs())
                        })
                        .fold(0.0, f64::max)
                        / z.get(CondKd)[0];
                    if e > 1e-9 {
                        *counts.entry("DIFFERENT".into()).or_default() += 1;
                    } else {
                        worst = worst.max(e);
                    }
                }
            }
            println!(
                "{name} {range}: {counts:?} worst/cond {worst:.1e} res {res:.1e} mean it {:.1} max {maxit} {:.1} us",
                its / 2000.0,
                t.elapsed().as_micros() as f64 / 2000.0
            );
        }
    }
}

//! Times of the mathematics in process.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a benchmark that fails stops")]
use sarrus_dynamics::{Field, FieldSet, Plan, Request, Wanted, Workspace};
use sarrus_models::{Options, Source, load};
use std::time::Instant;
fn noise(k: u64) -> f64 {
    let x = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 31).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
fn main() {
    let only = std::env::args().nth(1);
    let reps: usize = std::env::args().nth(2).map_or(200, |x| x.parse().unwrap());
    use Field::*;
    for name in ["lambda", "torso", "rh5v2_upper_body", "rh5v2_full", "stewart", "wrist"] {
        for numerical in [false, true] {
            let loaded = if numerical {
                let (urdf, yml) = sarrus_models::bundled_text(name).unwrap();
                let yml = yml
                    .replace("type: RRPR", "type: NUMERICAL")
                    .replace("type: 2SPU+1U", "type: NUMERICAL")
                    .replace("type: 6UPS", "type: NUMERICAL");
                load(&Source::Text { urdf: urdf.into(), submechanisms: Some(yml.into()) }, &Options::default())
            } else {
                load(&Source::Bundled(name.into()), &Options::default())
            };
            let model = loaded.unwrap_or_else(|e| panic!("{e}")).compiled.model;
            let s = model.sizes();
            let mut ws = Workspace::new(&model);
            const N: usize = 64;
            for (label, request, given, want) in [
                ("state", Request::Kinematics, vec![Y, Yd, Ydd], vec![Q, Qd, Qdd, U, Ud, Udd]),
                ("warm", Request::Kinematics, vec![Y, Yd, Ydd, QGuess], vec![Q, Qd, Qdd, U, Ud, Udd]),
                ("ID", Request::InverseDynamics, vec![Y, Yd, Ydd], vec![TauU]),
                ("FD", Request::ForwardDynamics, vec![Y, Yd, TauU], vec![Ydd]),
                ("FDwarm", Request::ForwardDynamics, vec![Y, Yd, TauU, QGuess], vec![Ydd]),
            ] {
                if only.as_deref().is_some_and(|o| o != format!("{name}/{label}") && o != format!("{name}/{label}/num")) {
                    continue;
                }
                if only.as_deref().is_some_and(|o| o.ends_with("/num") != numerical) {
                    continue;
                }
                let plan = Plan::new(&model, &Wanted::new(request, FieldSet::of(&given), FieldSet::of(&want))).unwrap();
                let qplan = Plan::new(&model, &Wanted::new(Request::Kinematics, FieldSet::of(&[Y]), FieldSet::of(&[Q]))).unwrap();
                let mut inputs = vec![];
                for k in 0..N {
                    let mut x = vec![0.0; plan.given().len()];
                    for slot in plan.given().slots() {
                        for i in slot.range() {
                            let scale = match slot.field {
                                Y => {
                                    if name == "stewart" && i < 3 {
                                        0.03
                                    } else {
                                        0.25
                                    }
                                }
                                Yd => 1.0,
                                Ydd => 5.0,
                                _ => 10.0,
                            };
                            x[i] = scale * noise((k * 1000 + i) as u64);
                        }
                    }
                    if let Some(slot) = plan.given().slot(QGuess) {
                        let y: Vec<f64> = (0..s.n_vy).map(|i| x[i] - 1e-3 * x[s.n_vy + i]).collect();
                        let mut q = vec![0.0; s.n_q];
                        let a = qplan.run(&model, &mut ws, &y, &mut q);
                        assert_eq!(a.status as u32, 0, "{name} {}", a.status);
                        x[slot.range()].copy_from_slice(&q);
                    }
                    inputs.push(x);
                }
                let mut out = vec![0.0; plan.want().len()];
                let mut times = vec![];
                for _ in 0..reps {
                    let t = Instant::now();
                    for x in &inputs {
                        let a = plan.run(&model, &mut ws, std::hint::black_box(x), &mut out);
                        assert!(a.status as u32 == 0, "{}", a.status);
                        std::hint::black_box(&out);
                    }
                    times.push(t.elapsed().as_nanos() as f64 / N as f64);
                }
                times.sort_by(f64::total_cmp);
                println!(
                    "{name:20} {:10} {label:8} median {:8.0} ns  min {:8.0} ns",
                    if numerical { "numerical" } else { "analytic" },
                    times[times.len() / 2],
                    times[0]
                );
            }
        }
    }
}

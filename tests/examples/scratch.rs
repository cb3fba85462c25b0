#![allow(missing_docs, clippy::unwrap_used)]
use sarrus_models::*;
use sarrus_simulation::*;
use std::time::Instant;
fn main() {
    let which = std::env::args().nth(1).unwrap();
    if which == "squeezer" {
        let l = load(&Source::Bundled("squeezer".into()), &Options::default()).unwrap();
        let m = &l.compiled.model;
        let link = |n: &str| m.link_names().iter().position(|x| x == n).unwrap();
        let springs = [Spring {
            from: Point { link: link("ground"), at: [0.014, 0.072, 0.0] },
            to: Point { link: link("K3"), at: [0.02, -0.018, 0.0] },
            stiffness: 4530.0,
            damping: 0.0,
            rest: 0.07785,
        }];
        let inputs = [Input { space: Space::Actuator, source: Source2::Constant(vec![0.033]) }];
        let setup = Setup { description: &l.description, compiled: &l.compiled, springs: &springs, inputs: &inputs };
        let start = Start::Independent { y: vec![0.0], yd: vec![0.0], guess: None };
        for (method, tol, step) in [
            (Method::Dop853, 1e-12, None),
            (Method::Dop853, 1e-9, None),
            (Method::Radau5, 1e-10, None),
            (Method::Radau5, 1e-12, None),
            (Method::RungeKutta, 0.0, Some(1e-5)),
            (Method::Euler, 0.0, Some(1e-5)),
        ] {
            let t0 = Instant::now();
            let run =
                simulate(&setup, &start, &Settings { rtol: tol, atol: tol, step, ..Settings::new(method, 0.03) }, &mut |_| ()).unwrap();
            let s = run.last().unwrap();
            println!(
                "{method:?} {tol:e} {:?} {} err q {:e} v {:e} drift {:e} res {:e} {:?} {:?} ev {:?}",
                run.end,
                s.time,
                s.y[0] - 15.81077119629904 - 0.0617138900142764496,
                s.yd[0] - 1139.920302151208,
                run.drift(),
                run.residual(),
                run.counts,
                t0.elapsed(),
                run.events.len()
            );
        }
    }
    if which == "fb" {
        let l = load(&Source::Bundled("four_bars_2".into()), &Options::default()).unwrap();
        let setup = Setup { description: &l.description, compiled: &l.compiled, springs: &[], inputs: &[] };
        let start = Start::Independent { y: vec![0.0], yd: vec![-1.0], guess: None };
        for (method, tol, step) in [
            (Method::Dop853, 1e-12, None),
            (Method::Dop853, 1e-9, None),
            (Method::Radau5, 1e-10, None),
            (Method::RungeKutta, 0.0, Some(1e-3)),
            (Method::RungeKutta, 0.0, Some(1e-2)),
            (Method::Euler, 0.0, Some(1e-3)),
        ] {
            let t0 = Instant::now();
            let run =
                simulate(&setup, &start, &Settings { rtol: tol, atol: tol, step, ..Settings::new(method, 10.0) }, &mut |_| ()).unwrap();
            let s = run.last().unwrap();
            println!(
                "{method:?} {tol:e} {:?} t {} B0 {} {} drift {:e} res {:e} {:?} {:?} ev {:?}",
                run.end,
                s.time,
                -(s.y[0]).sin() - 0.3284581115408154,
                (s.y[0]).cos() - 0.944518538178601,
                run.drift(),
                run.residual(),
                run.counts,
                t0.elapsed(),
                &run.events[..run.events.len().min(4)]
            );
        }
    }
}
use sarrus_models::Source;
use sarrus_simulation::Source as Source2;

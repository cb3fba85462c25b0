//! Round trips of a running server: `round_trip NAME lane|requests [COUNT [PAUSE_US]]`, the pause
//! before each request.

use std::time::{Duration, Instant};

use sarrus_client::{
    ConnectOptions, Field, FieldSet, Query, Request, Robot, Transport, WaitStrategy,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "default".to_owned());
    let transport = if arguments.next().as_deref() == Some("requests") {
        Transport::Service
    } else {
        Transport::Lane
    };
    let count: usize = arguments.next().map_or(Ok(200_000), |text| text.parse())?;

    let pause = Duration::from_micros(arguments.next().map_or(Ok(0), |text| text.parse())?);
    let options = ConnectOptions {
        transport,
        wait_strategy: WaitStrategy::Busy,
        ..ConnectOptions::default()
    };
    let mut robot = Robot::connect_with(&name, options)?;
    println!(
        "{}: {} independent coordinates, {transport:?}",
        robot.model().robot,
        robot.model().independent.len()
    );
    for (given, want) in [
        (FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::U])),
        (
            FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]),
            FieldSet::of(&[Field::Q, Field::Qd, Field::Qdd]),
        ),
        (FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::G, Field::K, Field::GU])),
    ] {
        let plan = robot.prepare(&Query::new(Request::Kinematics, given, want))?;
        let (n_in, n_out) =
            robot.plan(plan).map_or((0, 0), |plan| (plan.given().len(), plan.want().len()));
        let input = vec![0.1; n_in];
        let mut output = vec![0.0; n_out];
        let mut ask = || robot.ask(plan, &input, &mut output);
        for _ in 0..count / 10 {
            ask()?.ok()?;
        }
        let mut times = Vec::with_capacity(count);
        for _ in 0..count {
            if !pause.is_zero() {
                std::thread::sleep(pause);
            }
            let start = Instant::now();
            let answer = ask()?;
            times.push(start.elapsed());
            answer.ok()?;
        }
        times.sort_unstable();
        let at = |quantile: f64| {
            times
                .get((quantile * count as f64) as usize)
                .copied()
                .unwrap_or(Duration::MAX)
                .as_nanos()
        };
        println!(
            "{n_in:5} in {n_out:5} out: p50 {:6} ns  p99 {:6} ns  p99.9 {:7} ns",
            at(0.5),
            at(0.99),
            at(0.999)
        );
    }
    std::thread::sleep(Duration::from_millis(100));
    println!("{:?}", robot.statistics());
    Ok(())
}

//! What must hold on every robot.

use sarrus_models::Options;
use sarrus_tests::cases::{Case, SEEDS, robots};
use sarrus_tests::random::random_robot;

#[test]
fn every_random_robot_can_be_read() {
    let mut failures = Vec::new();
    for seed in 0..SEEDS {
        if let Err(error) = Case::of_text(&random_robot(seed), seed, &Options::default()) {
            failures.push(error);
        }
    }
    assert!(failures.is_empty(), "{} of {SEEDS}\n{}", failures.len(), failures.join("\n"));
    println!("{} robots", robots().len());
}

//! `sarrus-can arm`, `disarm` and `reset`: what an operator tells a running bridge.

use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use sarrus_client::Observer;
use sarrus_client::actuators::{Operation, Reason, Standing};

/// Flags of the three.
#[derive(Args)]
pub(crate) struct Operate {
    /// Name of the bridge
    #[arg(default_value = "default")]
    name: String,
    /// Wait at most this long for the bridge to be where it is to go `[s]`
    #[arg(long, default_value_t = 5.0)]
    timeout: f64,
}

impl Operate {
    /// 0 when the bridge is where it was to go, 1 when it is not (and why), 2 without a bridge.
    pub(crate) fn run(&self, operation: Operation) -> ExitCode {
        let name = operation.name();
        let observer = match Observer::connect(&self.name) {
            Ok(observer) => observer,
            Err(error) => {
                eprintln!("sarrus-can {name}: {error}");
                return ExitCode::from(2);
            }
        };
        let asked = observer.operate(operation);
        let patience = Duration::try_from_secs_f64(self.timeout).unwrap_or(Duration::MAX);
        let begin = Instant::now();
        let (mut standing, mut reason) = (None, None);
        let mut has_begun = operation != Operation::Arm;
        while begin.elapsed() < patience {
            if let Some(state) = observer.state().filter(|state| state.stamp_ns > asked) {
                (standing, reason) = (Standing::from_code(state.standing), Reason::from_code(state.reason));
                has_begun |= standing != Some(Standing::Disabled) || reason != Some(Reason::None);
                let is_there = match (operation, standing) {
                    (Operation::Arm, Some(Standing::Enabled)) => true,
                    (Operation::Disarm, Some(Standing::Disabled | Standing::Fault)) => true,
                    (Operation::Reset, Some(Standing::Disabled | Standing::Arming | Standing::Enabled)) => true,
                    // refused, or given up
                    (Operation::Arm, Some(Standing::Disabled | Standing::Fault)) if has_begun => break,
                    _ => false,
                };
                if is_there {
                    println!("{}", standing.map_or("unknown", Standing::name));
                    return ExitCode::SUCCESS;
                }
            }
            thread::sleep(Duration::from_millis(5));
        }
        let (standing, reason) = (standing.map_or("silent", Standing::name), reason.map_or("unknown", Reason::name));
        eprintln!("sarrus-can {name}: the bridge is {standing}: {reason}");
        ExitCode::from(1)
    }
}

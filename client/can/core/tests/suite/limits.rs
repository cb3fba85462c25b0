//! Limits in a configuration, as far as protocols are concerned.

use sarrus_can_core::config::{Configuration, Surroundings};

fn read(drive: &str, limits: &str, damping: f64) -> Result<Configuration, String> {
    let text = format!(
        "rate_hz: 250\nbuses: [{{name: a, channel: can0}}]\nmotors: [{{actuator: elbow, bus: a, \
            gear: 10, watchdog_ms: 50, offset: 0, damping: {damping}, limits: {limits}, drive: \
            {drive}}}]\n"
    );
    let surroundings =
        Surroundings { file: &|_| Err(String::new()), robot: &|_| panic!("no robot") };
    Configuration::read("motors.yml", text.into_bytes(), &surroundings)
        .map_err(|report| report.to_string())
}

#[test]
fn a_mode_whose_torque_nothing_limits_is_refused_with_the_reason() {
    const MODE: &str = "nothing limits the torque of the ODrive's mode position";
    let odrive = |more: &str| format!("{{protocol: odrive, node: 3, mode: position{more}}}");
    let limits = "{position: [-3, 3], effort: 0.5, velocity: 5}";
    assert!(read(&odrive(""), limits, 0.0).unwrap_err().contains(MODE));
    let with_constant = odrive(", motor_torque_constant: 0.05");
    let configuration = read(&with_constant, limits, 0.0).unwrap();
    let common = configuration.motors[0].common;
    assert_eq!((common.torque_limit, common.velocity_limit), (0.05, 50.0), "those of the motor");
    for protocol in ["rmd, id: 1", "ak_servo, id: 1, pole_pairs: 21, reduction: 9"] {
        let drive = |mode: &str| {
            format!("{{protocol: {protocol}, motor_torque_constant: 1, mode: {mode}}}")
        };
        assert!(read(&drive("torque"), limits, 0.0).is_ok());
        assert!(read(&drive("position"), limits, 0.0).unwrap_err().contains("does not know"));
    }
}

#[test]
fn a_damping_that_becomes_no_code_is_warned_of() {
    let drive = "{protocol: mit, variant: damiao, id: 1, reply_id: 17, position_range: 12.5, \
        velocity_range: 30, torque_range: 10, stiffness_range: 500, damping_range: 5}";
    let warnings = |damping: f64| {
        let configuration =
            read(drive, "{position: [-1, 1], effort: 1, velocity: 1}", damping).unwrap();
        let is_it = |warning: &&_| format!("{warning:?}").contains("is no code of this motor");
        configuration.warnings.iter().filter(is_it).count()
    };
    // a code is 0.00122 N m s/rad at the motor, a hundred times as much at the actuator
    assert_eq!([0.0, 0.12, 0.13].map(warnings), [0, 1, 0]);
}

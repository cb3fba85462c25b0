//! The robots that come with sarrus.

struct Bundled {
    name: &'static str,
    about: &'static str,
    urdf: &'static str,
    submechanisms: &'static str,
}

macro_rules! robots {
    ($($name:literal: $about:literal,)*) => {
        [$(Bundled {
            name: $name,
            about: $about,
            urdf: include_str!(concat!("../robots/", $name, "/", $name, ".urdf")),
            submechanisms: include_str!(concat!("../robots/", $name, "/", $name, ".yml")),
        },)*]
    };
}

static ROBOTS: [Bundled; 28] = robots! {
    "lambda": "elbow of a humanoid: one lambda loop (RRPR) driven by a linear actuator",
    "torso": "torso of a humanoid: a universal joint driven by two linear actuators (2SPU+1U)",
    "ankle": "ankle of a humanoid: a universal joint driven by two offset linear actuators \
     (2SPRR+1U)",
    "parallelogram": "parallelogram of crank, follower and coupler",
    "stewart": "Stewart platform: six free directions on six linear actuators (6UPS)",
    "wrist": "wrist of a humanoid: two actuators, rockers and rods; every loop numerical",
    "r3_lambda_r": "arm: three revolute joints, a lambda elbow, a roll joint",
    "rh5v2_upper_body": "upper body of a humanoid with 23 joints: torso and two arms with lambda \
     elbows",
    "rh5v2_full": "upper body of a humanoid with head and parallel wrists: 50 joints, numerical \
     and analytic loops side by side",
    "four_bars_2": "two four-bars in a row, of unit cranks and couplers (IFToMM A02)",
    "five_bar": "planar five-bar on two motors",
    "squeezer": "Andrews' squeezing mechanism: seven bodies, one freedom (IVP test set)",
    "bricard": "Bricard's mechanism of five rods: overconstrained, one freedom (IFToMM A04)",
    "delta": "delta robot: three arms, six rods, a platform that keeps its orientation",
    "active_ankle": "ankle of three cranks and six rods, almost spherical (3RUS2)",
    "stewart_floating": "Stewart platform whose platform is one floating joint of seven \
     coordinates",
    "g1_ankle": "ankle as of Unitree's G1: a universal joint on two motors, cranks and rods",
    "jansen": "leg of Jansen's Strandbeest: one crank, four rods, two triangles",
    "three_rrr": "planar platform on three legs of two links (3-RRR)",
    "gripper": "gripper of two adaptive fingers on one motor, like Robotiq's 2F-85",
    "bennett": "Bennett's linkage of four hinges in space: overconstrained, one freedom",
    "agile_eye": "agile eye: spherical 3-RRR with orthogonal axes",
    "wheel_leg": "body on two wheeled legs, each a five-bar with motors at hips and wheel",
    "delta_balls": "delta robot with ball joints at both ends of its rods, which may spin",
    "cassie_leg": "leg of Cassie: hips, springs, tarsus on the Achilles rod, four-bar at the foot",
    "cassie": "whole Cassie: pelvis and two legs with springs, tarsi on Achilles rods, four-bars",
    "digit_tarsus": "lower leg of Digit: tarsus on the Achilles rod, foot on two motors and rods",
    "kangaroo_leg": "leg of Kangaroo: six linear motors above the knee, linkages to shin and foot",
};

/// Names of the bundled robots, each with one line about it.
pub fn bundled() -> impl Iterator<Item = (&'static str, &'static str)> {
    ROBOTS.iter().map(|robot| (robot.name, robot.about))
}

/// The URDF and the submechanism file of a bundled robot.
pub fn bundled_text(name: &str) -> Option<(&'static str, &'static str)> {
    ROBOTS.iter().find(|robot| robot.name == name).map(|robot| (robot.urdf, robot.submechanisms))
}

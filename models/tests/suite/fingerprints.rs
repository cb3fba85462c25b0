//! The fingerprints of the bundled robots, by which clients, configurations and logs know them.

use sarrus_models::bundled;

use super::*;

const FINGERPRINTS: [(&str, u64); 28] = [
    ("lambda", 0x95ec_5127_e53b_89b8),
    ("torso", 0x0a07_3552_f703_daeb),
    ("ankle", 0xaf02_04c9_1a56_4ed9),
    ("parallelogram", 0x5477_072e_3724_4082),
    ("stewart", 0xaa24_718e_e6b4_712d),
    ("wrist", 0x4248_5cce_a633_87e4),
    ("r3_lambda_r", 0x9781_357f_51f6_5892),
    ("rh5v2_upper_body", 0xa194_7867_99b7_6e85),
    ("rh5v2_full", 0x8345_c289_62f6_f7d2),
    ("four_bars_2", 0x20df_e02d_9ee0_acb7),
    ("five_bar", 0x4f01_0f58_9796_d06d),
    ("squeezer", 0xcefb_fb05_af0a_2e6f),
    ("bricard", 0x6ffa_bf98_c353_0a63),
    ("delta", 0xc002_fa24_39b2_3964),
    ("active_ankle", 0x9b27_0d15_8dcb_bf9a),
    ("stewart_floating", 0x65fc_912c_c35e_952e),
    ("g1_ankle", 0xb23c_6704_3a83_063a),
    ("jansen", 0xdca5_544b_a911_f1a7),
    ("three_rrr", 0x009f_3d5d_6840_db27),
    ("gripper", 0x2567_b6ce_9b63_d8c3),
    ("bennett", 0x0160_11e7_3db9_2dc1),
    ("agile_eye", 0x0286_d12c_fbad_5ff6),
    ("wheel_leg", 0x4b64_72f8_39c5_f6d2),
    ("delta_balls", 0x2e7d_1de6_9476_27b9),
    ("cassie_leg", 0x3f6d_8c3b_df10_df43),
    ("cassie", 0xeab8_fac6_183a_bd34),
    ("digit_tarsus", 0x012b_c1a3_c657_e38c),
    ("kangaroo_leg", 0x0ea1_e8c1_3ad2_5479),
];

#[test]
fn every_bundled_robot_keeps_its_fingerprint() {
    let found: Vec<(&str, u64)> = bundled()
        .map(|(name, _)| {
            let loaded = load(&Source::Bundled(name.into()), &Options::default())
                .unwrap_or_else(|error| panic!("{error}"));
            (name, loaded.compiled.model.fingerprint())
        })
        .collect();
    assert_eq!(found, FINGERPRINTS, "{found:#018x?}");
}

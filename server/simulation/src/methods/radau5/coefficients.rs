//! Numbers of Radau's method of order five (Hairer and Wanner II, IV.5 and IV.8).

const ROOT_6: f64 = 2.449_489_742_783_178;
/// Places of the stages in a step.
pub(super) const C: [f64; 3] = [(4.0 - ROOT_6) / 10.0, (4.0 + ROOT_6) / 10.0, 1.0];
/// The real eigenvalue γ of A⁻¹.
pub(super) const GAMMA: f64 = 3.637_834_252_744_496;
/// Real and imaginary part of its complex eigenvalues α ± iβ.
pub(super) const ALPHA: f64 = 2.681_082_873_627_752_3;
pub(super) const BETA: f64 = 3.050_430_199_247_410_5;
/// A⁻¹ = T Λ T⁻¹, Λ = diag(γ, [α −β; β α]).
pub(super) const T: [[f64; 3]; 3] = [
    [0.091_232_394_870_892_94, -0.141_255_295_020_954_2, -0.030_029_194_105_147_424],
    [0.241_717_932_707_107, 0.204_129_352_293_799_93, 0.382_942_112_757_261_9],
    [0.966_048_182_615_093, 1.0, 0.0],
];
pub(super) const T_INVERSE: [[f64; 3]; 3] = [
    [4.325_579_890_063_155, 0.339_199_251_815_809_87, 0.541_770_539_935_874_9],
    [-4.178_718_591_551_905, -0.327_682_820_761_062_4, 0.476_623_554_500_550_45],
    [-0.502_872_634_945_786_9, 2.571_926_949_855_605, -0.596_039_204_828_224_9],
];
/// Weights of the stages in the error estimate (8.19), times γ.
pub(super) const E: [f64; 3] =
    [-(13.0 + 7.0 * ROOT_6) / 3.0, (-13.0 + 7.0 * ROOT_6) / 3.0, -1.0 / 3.0];

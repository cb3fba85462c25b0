#![doc = include_str!("closures.md")]

use sarrus_dynamics::description::SubmechanismKind;

/// Where the closure of a type is singular: its dependents cannot be distinguished from its
/// independents there.
pub(crate) fn singular(kind: SubmechanismKind) -> &'static str {
    match kind {
        SubmechanismKind::Rrpr => "no length of slide between the stator's axis and the pin",
        SubmechanismKind::Spu2U1 | SubmechanismKind::Ups6 => {
            "a leg along its first axis, or of no length"
        }
        SubmechanismKind::Sprr2U1 => {
            "a leg's pin in the plane of its first axis and of its second's direction, or a leg \
             of no length"
        }
        SubmechanismKind::Surrpr2U1 => {
            "a crank and its rod in one plane with the crank's axis, a rod along the first axis of \
             its universal joint, or no length of slide between a stator's axis and its pin"
        }
        SubmechanismKind::ParallelogramChain => "all bars in one line",
        SubmechanismKind::FourBar => "coupler and rocker in one line",
        SubmechanismKind::SliderCrank => "the coupler square to the slide",
        SubmechanismKind::Transmission
        | SubmechanismKind::Differential
        | SubmechanismKind::Serial => "none",
        _ => "",
    }
}

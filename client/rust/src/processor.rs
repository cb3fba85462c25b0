//! Whether this processor can run this build, and this process its programs.

use rustix::process::{Resource, getrlimit};

/// Least stack of a program's main thread `[byte]`: reading flags and files takes half of it.
const STACK: u64 = 512 << 10;

/// Programs call this first, to end with a message instead of a signal.
///
/// # Errors
/// The message: a feature that the processor lacks, or the limit of the stack.
pub fn check_for(program: &str) -> Result<(), String> {
    if let Err(missing) = check() {
        return Err(format!(
            "{program}: this processor has no {missing}; {program} is built for x86-64-v3 (FMA and \
             AVX2, processors from 2015 on)"
        ));
    }
    match getrlimit(Resource::Stack).current {
        Some(limit) if limit < STACK => Err(format!(
            "{program}: the stack is limited to {limit} bytes, expected {STACK} or more: \
             `ulimit -s 8192`"
        )),
        _ => Ok(()),
    }
}

/// Libraries built for x86-64-v3 call this first, to end with a message instead of an illegal
/// instruction.
///
/// # Errors
/// The first missing feature of the baseline.
#[cfg(all(target_arch = "x86_64", target_feature = "fma", target_feature = "avx2"))]
pub fn check() -> Result<(), &'static str> {
    // queries the processor itself: std's macro answers at compile time if the build assumes a
    // feature
    let processor = raw_cpuid::CpuId::new();
    if !processor.get_feature_info().is_some_and(|features| features.has_fma()) {
        return Err("FMA");
    }
    if !processor.get_extended_feature_info().is_some_and(|features| features.has_avx2()) {
        return Err("AVX2");
    }
    Ok(())
}

/// Other processors, and builds with the feature `portable` alone, assume neither.
///
/// # Errors
/// None.
#[cfg(not(all(target_arch = "x86_64", target_feature = "fma", target_feature = "avx2")))]
pub fn check() -> Result<(), &'static str> {
    Ok(())
}

//! Whether this processor can run this build.

/// Programs built for x86-64-v3 call this first, to end with a message instead of an illegal
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

//! Whether this processor can run what was built.

/// Programs that are built for x86-64-v3 ask this before anything else, to end in words and not by
/// an instruction that is not there.
///
/// # Errors
/// All features of that baseline that are missing, such as `FMA, AVX2`; `YMM registers` where the
/// operating system does not save these.
#[cfg(all(target_arch = "x86_64", target_feature = "fma", target_feature = "avx2"))]
pub fn check() -> Result<(), String> {
    /// In front of AVX's upper halves: the legacy region, the header and the halves themselves.
    const AREA_WITH_YMM: u32 = 512 + 64 + 256;
    // the processor itself is asked: std's macro answers at compile time where the build assumes a
    // feature
    let processor = raw_cpuid::CpuId::new();
    let basic = processor.get_feature_info();
    let basic = basic.as_ref();
    let extended = processor.get_extended_feature_info();
    let extended = extended.as_ref();
    let identifiers = processor.get_extended_processor_and_feature_identifiers();
    // the area of all that XCR0 enables, which is readable without an instruction of XSAVE
    let saved = processor.get_extended_state_info();
    let area = saved.map_or(0, |state| state.xsave_area_size_enabled_features());
    let features = [
        ("FMA", basic.is_some_and(|found| found.has_fma())),
        ("AVX2", extended.is_some_and(|found| found.has_avx2())),
        ("BMI1", extended.is_some_and(|found| found.has_bmi1())),
        ("BMI2", extended.is_some_and(|found| found.has_bmi2())),
        ("LZCNT", identifiers.is_some_and(|found| found.has_lzcnt())),
        ("F16C", basic.is_some_and(|found| found.has_f16c())),
        ("MOVBE", basic.is_some_and(|found| found.has_movbe())),
        ("YMM registers", basic.is_some_and(|found| found.has_oxsave()) && area >= AREA_WITH_YMM),
    ];
    let mut missing = String::new();
    for (name, is_there) in features {
        if !is_there {
            if !missing.is_empty() {
                missing.push_str(", ");
            }
            missing.push_str(name);
        }
    }
    if missing.is_empty() { Ok(()) } else { Err(missing) }
}

/// Other processors, and builds with the feature `portable` alone, assume none of these.
///
/// # Errors
/// None.
#[cfg(not(all(target_arch = "x86_64", target_feature = "fma", target_feature = "avx2")))]
pub fn check() -> Result<(), String> {
    Ok(())
}

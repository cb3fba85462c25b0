//! FNV-1a: names derived from contents.

/// FNV-1a of 64 bits: h ← (h ⊕ byte) · 0x100000001b3 from 0xcbf29ce484222325 (G. Fowler,
/// L. C. Noll, K.-P. Vo; RFC 9923).
pub fn fnv1a_64(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

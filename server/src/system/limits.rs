//! Limits and capabilities of this process, as `/proc` has them.

use std::fmt;

/// Memory may be locked beyond `RLIMIT_MEMLOCK` (linux/capability.h).
pub const CAP_IPC_LOCK: u32 = 14;
/// Permits every real-time priority, beyond `RLIMIT_RTPRIO` (linux/capability.h).
pub const CAP_SYS_NICE: u32 = 23;

/// A resource limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// None.
    Unlimited,
    /// At most this, in the resource's unit.
    Value(u64),
}

impl Limit {
    /// Whether this much is permitted.
    pub fn permits(self, wanted: u64) -> bool {
        match self {
            Limit::Unlimited => true,
            Limit::Value(value) => wanted <= value,
        }
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Limit::Unlimited => f.write_str("unlimited"),
            Limit::Value(value) => value.fmt(f),
        }
    }
}

/// The soft limit of a name as `/proc/self/limits` has it, such as `Max locked memory`.
pub fn soft_limit(limits: &str, name: &str) -> Option<Limit> {
    let line = limits.lines().find_map(|line| line.strip_prefix(name))?;
    match line.split_whitespace().next()? {
        "unlimited" => Some(Limit::Unlimited),
        number => number.parse().ok().map(Limit::Value),
    }
}

/// Whether a capability is effective, by `/proc/self/status`.
pub fn has_capability(status: &str, capability: u32) -> Option<bool> {
    let bits = status.lines().find_map(|line| line.strip_prefix("CapEff:"))?;
    u64::from_str_radix(bits.trim(), 16).ok().map(|bits| bits >> capability & 1 == 1)
}

/// A limit of this process and whether a capability overrides it. An unreadable limit counts as
/// unlimited; the system call itself decides.
pub(crate) fn of_this_process(name: &str, capability: u32) -> (Limit, bool) {
    let read = |path| std::fs::read_to_string(path).unwrap_or_default();
    let limit = soft_limit(&read("/proc/self/limits"), name).unwrap_or(Limit::Unlimited);
    (limit, has_capability(&read("/proc/self/status"), capability).unwrap_or(false))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: &str = "\
Limit                     Soft Limit           Hard Limit           Units
Max open files            20000                20000                files
Max locked memory         8388608              8388608              bytes
Max realtime priority     0                    0
Max realtime timeout      unlimited            unlimited            us
";

    #[test]
    fn limits_are_read_by_name() {
        let limit = |name| soft_limit(LIMITS, name);
        assert_eq!(limit("Max locked memory"), Some(Limit::Value(8 << 20)));
        assert_eq!(limit("Max realtime priority"), Some(Limit::Value(0)));
        assert_eq!(limit("Max realtime timeout"), Some(Limit::Unlimited));
        assert_eq!(limit("Max dreams"), None);
        assert_eq!(soft_limit("Max open files many", "Max open files"), None);
    }

    #[test]
    fn capabilities_are_bits_of_one_number() {
        let status = "Name:\tsarrus\nCapEff:\t0000000000804000\n";
        assert_eq!(has_capability(status, CAP_IPC_LOCK), Some(true));
        assert_eq!(has_capability(status, CAP_SYS_NICE), Some(true));
        assert_eq!(has_capability(status, 0), Some(false));
        assert_eq!(has_capability("CapEff: cloud", 0), None);
        assert_eq!(has_capability("", 0), None);
    }
}

//! The parts of an ELF file that are checked before the system's loader reads it.

/// Symbols that a kernel may take from other objects: those of its C, those that compilers put in
/// for it, and those of every shared object.
const SYMBOLS: [&str; 11] = [
    "sqrt",
    "fma",
    "fabs",
    "memcpy",
    "memset",
    "__stack_chk_fail",
    "__stack_chk_guard",
    "__cxa_finalize",
    "__gmon_start__",
    "_ITM_deregisterTMCloneTable",
    "_ITM_registerTMCloneTable",
];

/// Bytes of a symbol's name that are read.
const NAME: usize = 80;

/// A 64-bit ELF file in this computer's order of bytes.
#[derive(Clone, Copy)]
pub(super) struct Elf<'a>(&'a [u8]);

/// The place and the number of the entries of a table, and the size of each.
struct Table {
    start: u64,
    entry: u64,
    count: u64,
}

impl<'a> Elf<'a> {
    /// The file, if it begins as one.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Elf<'a>> {
        const CLASS_64: u8 = 2;
        const ORDER: u8 = if cfg!(target_endian = "little") { 1 } else { 2 };
        (bytes.get(..6)? == [0x7f, b'E', b'L', b'F', CLASS_64, ORDER]).then_some(Elf(bytes))
    }

    /// Whether every part that the loader maps is in the file: reading beyond its end would end the
    /// process.
    pub(super) fn is_whole(self) -> Option<bool> {
        const LOAD: u64 = 1;
        let programs =
            Table { start: self.u64(0x20)?, entry: self.u16(0x36)?, count: self.u16(0x38)? };
        let mut is_whole = programs.entry >= 56;
        for table in [&programs, &self.sections()?] {
            is_whole &= self.has(table.start, table.entry * table.count);
        }
        for k in 0..programs.count {
            let at = programs.start.checked_add(k * programs.entry)?;
            if self.u32(at)? == LOAD {
                is_whole &= self.has(self.u64(at.checked_add(8)?)?, self.u64(at + 32)?);
            }
        }
        Some(is_whole)
    }

    /// The first symbol beyond [`SYMBOLS`] that it takes from another object; `None` of a whole
    /// file without a table of symbols.
    pub(super) fn first_stranger(self) -> Option<Option<String>> {
        const DYNAMIC_SYMBOLS: u64 = 11;
        const SYMBOL: u64 = 24;
        let sections = self.sections()?;
        let section = |k: u64| sections.start.checked_add(k.checked_mul(sections.entry)?);
        let mut table = None;
        for k in 0..sections.count {
            if self.u32(section(k)?.checked_add(4)?)? == DYNAMIC_SYMBOLS {
                table = section(k);
            }
        }
        let table = table?;
        let start = self.u64(table.checked_add(0x18)?)?;
        let size = self.u64(table.checked_add(0x20)?)?;
        let names = self.u64(section(self.u32(table.checked_add(0x28)?)?)?.checked_add(0x18)?)?;
        // the first one is empty
        for k in 1..size / SYMBOL {
            let at = start.checked_add(k * SYMBOL)?;
            let is_defined = self.u16(at.checked_add(6)?)? != 0;
            let name = self.0.get(names.checked_add(self.u32(at)?)? as usize..)?;
            let name = name.iter().take(NAME).take_while(|byte| **byte != 0).copied();
            let name = String::from_utf8_lossy(&name.collect::<Vec<u8>>()).into_owned();
            if !is_defined && !SYMBOLS.contains(&name.as_str()) {
                return Some(Some(name));
            }
        }
        Some(None)
    }

    fn sections(self) -> Option<Table> {
        Some(Table { start: self.u64(0x28)?, entry: self.u16(0x3a)?, count: self.u16(0x3c)? })
    }

    /// Whether these bytes are in the file.
    fn has(self, from: u64, size: u64) -> bool {
        from.checked_add(size).is_some_and(|end| end <= self.0.len() as u64)
    }

    fn u16(self, at: u64) -> Option<u64> {
        self.bytes(at).map(u16::from_ne_bytes).map(u64::from)
    }

    fn u32(self, at: u64) -> Option<u64> {
        self.bytes(at).map(u32::from_ne_bytes).map(u64::from)
    }

    fn u64(self, at: u64) -> Option<u64> {
        self.bytes(at).map(u64::from_ne_bytes)
    }

    fn bytes<const N: usize>(self, at: u64) -> Option<[u8; N]> {
        let at = usize::try_from(at).ok()?;
        self.0.get(at..at.checked_add(N)?)?.try_into().ok()
    }
}

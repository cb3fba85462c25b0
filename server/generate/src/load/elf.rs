//! The parts of an ELF file that are checked before the system's loader reads it.

/// Symbols that a kernel may take from other objects: those of its C, those that compilers put in
/// for it, and those of every shared object.
const SYMBOLS: &str = "sqrt fma fabs memcpy memset __stack_chk_fail __stack_chk_guard \
    __cxa_finalize __gmon_start__ _ITM_deregisterTMCloneTable _ITM_registerTMCloneTable";

/// Bytes of a symbol's name that are read.
const NAME: usize = 80;

/// A 64-bit ELF file in this computer's order of bytes.
#[derive(Clone, Copy)]
pub(super) struct Elf<'a>(&'a [u8]);

/// The place of a table in the file, the size of its entries, and their number.
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
        let [programs, sections] = [self.table(0x20, 0x36)?, self.table(0x28, 0x3a)?];
        let mut is_whole = programs.entry >= 56;
        for table in [&programs, &sections] {
            is_whole &= self.has(table.start, table.entry * table.count);
        }
        for k in 0..programs.count {
            let at = programs.at(k)?;
            if self.number(at, 4)? == LOAD {
                is_whole &= self.has(self.number(at + 8, 8)?, self.number(at + 32, 8)?);
            }
        }
        Some(is_whole)
    }

    /// The first symbol beyond [`SYMBOLS`] that it takes from another object; `None` of a whole
    /// file without a table of symbols.
    pub(super) fn first_stranger(self) -> Option<Option<String>> {
        const DYNAMIC_SYMBOLS: u64 = 11;
        const SYMBOL: u64 = 24;
        let sections = self.table(0x28, 0x3a)?;
        let mut places = (0..sections.count).filter_map(|k| sections.at(k));
        let place = places.find(|at| self.number(at + 4, 4) == Some(DYNAMIC_SYMBOLS))?;
        let [start, size] = [self.number(place + 0x18, 8)?, self.number(place + 0x20, 8)?];
        let names = self.number(sections.at(self.number(place + 0x28, 4)?)? + 0x18, 8)?;
        let symbols = Table { start, entry: SYMBOL, count: size / SYMBOL };
        // the first one is empty
        for k in 1..symbols.count {
            let at = symbols.at(k)?;
            let is_defined = self.number(at + 6, 2)? != 0;
            let name = self.0.get(names.checked_add(self.number(at, 4)?)? as usize..)?;
            let name = name.iter().take(NAME).take_while(|byte| **byte != 0).copied();
            let name = String::from_utf8_lossy(&name.collect::<Vec<u8>>()).into_owned();
            if !is_defined && !SYMBOLS.split(' ').any(|of| of == name) {
                return Some(Some(name));
            }
        }
        Some(None)
    }

    /// The table whose place is at `start`, and the size and the number of entries at `sizes`.
    fn table(self, start: u64, sizes: u64) -> Option<Table> {
        let [entry, count] = [self.number(sizes, 2)?, self.number(sizes + 2, 2)?];
        Some(Table { start: self.number(start, 8)?, entry, count })
    }

    /// Whether these bytes are in the file.
    fn has(self, from: u64, size: u64) -> bool {
        from.checked_add(size).is_some_and(|end| end <= self.0.len() as u64)
    }

    /// The number of so many bytes here.
    fn number(self, at: u64, size: u64) -> Option<u64> {
        let part = self.0.get(at as usize..at.checked_add(size)? as usize)?;
        let fold = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        Some(match cfg!(target_endian = "little") {
            true => part.iter().rev().fold(0, fold),
            false => part.iter().fold(0, fold),
        })
    }
}

impl Table {
    /// The place of an entry, far enough from the end of all numbers to add its fields.
    fn at(&self, k: u64) -> Option<u64> {
        let at = self.start.checked_add(k.checked_mul(self.entry)?)?;
        (at < 1 << 48).then_some(at)
    }
}

//! The parts of a shared library that decide whether Android loads it.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use object::elf::{
    DF_TEXTREL, DT_FLAGS, DT_NEEDED, DT_SONAME, DT_TEXTREL, EM_AARCH64, ET_DYN, FileHeader64,
    PT_DYNAMIC, PT_LOAD, SHT_DYNSYM, STB_LOCAL, STB_WEAK,
};
use object::read::elf::{Dyn as _, FileHeader as _, ProgramHeader as _, Sym as _};
use object::{Endianness, FileKind};

/// A file that is not a library that could be checked.
#[derive(Debug, thiserror::Error)]
pub enum ElfError {
    /// Another kind of file altogether.
    #[error("{name} is not a 64-bit ELF file")]
    NotElf {
        /// The library's file name.
        name: String,
    },
    /// Cut off or damaged.
    #[error("{name} is a damaged ELF file: {source}")]
    Damaged {
        /// The library's file name.
        name: String,
        /// The parser's error.
        #[source]
        source: object::Error,
    },
    /// An object file or a program without dynamic linking.
    #[error("{name} has no dynamic section: it is not a shared library")]
    NotDynamic {
        /// The library's file name.
        name: String,
    },
}

/// An undefined symbol of a library.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Undefined {
    /// The symbol.
    pub name: String,
    /// Whether the library loads without it.
    pub weak: bool,
}

/// What the loader reads of a library.
#[derive(Debug, Clone)]
pub struct Library {
    /// Its file name, `libmain.so`.
    pub name: String,
    /// The machine it is for, as ELF numbers them; 183 is aarch64.
    pub machine: u16,
    /// Whether it is a shared object, which is what Android loads.
    pub shared: bool,
    /// Its `DT_SONAME`.
    pub soname: Option<String>,
    /// The libraries it cannot be loaded without.
    pub needed: Vec<String>,
    /// Its undefined symbols.
    pub undefined: BTreeSet<Undefined>,
    /// Its exported symbols.
    pub exports: BTreeSet<String>,
    /// The alignment of each segment that is mapped, in bytes.
    pub alignments: Vec<u64>,
    /// Whether each segment's place in the file and in memory agree to within its alignment, as mapping it needs.
    pub congruent: bool,
    /// Whether the loader would have to write into code, which Android refuses.
    pub text_relocations: bool,
    /// Names of libraries (`libvulkan.so`) that stand anywhere in it, so also those it opens while it runs.
    pub named: BTreeSet<String>,
}

impl Library {
    /// Reads the library `name` from the bytes of its file.
    ///
    /// # Errors
    /// [`ElfError`], if it is no 64-bit ELF file with a dynamic section, or a damaged one.
    pub fn read(name: &str, data: &[u8]) -> Result<Self, ElfError> {
        if !matches!(FileKind::parse(data), Ok(FileKind::Elf64)) {
            return Err(ElfError::NotElf {
                name: name.to_owned(),
            });
        }
        let damaged = |source| ElfError::Damaged {
            name: name.to_owned(),
            source,
        };
        let header = FileHeader64::<Endianness>::parse(data).map_err(damaged)?;
        let endian = header.endian().map_err(damaged)?;
        let sections = header.sections(endian, data).map_err(damaged)?;
        let mut library = Self {
            name: name.to_owned(),
            machine: header.e_machine(endian).0,
            shared: header.e_type(endian) == ET_DYN,
            soname: None,
            needed: Vec::new(),
            undefined: BTreeSet::new(),
            exports: BTreeSet::new(),
            alignments: Vec::new(),
            congruent: true,
            text_relocations: false,
            named: named_libraries(data),
        };
        let mut dynamic = None;
        for segment in header.program_headers(endian, data).map_err(damaged)? {
            match segment.p_type(endian) {
                PT_LOAD => {
                    let alignment = segment.p_align(endian);
                    let apart = segment
                        .p_vaddr(endian)
                        .wrapping_sub(segment.p_offset(endian));
                    library.congruent &= alignment == 0 || apart.is_multiple_of(alignment);
                    library.alignments.push(alignment);
                }
                PT_DYNAMIC => dynamic = segment.dynamic(endian, data).map_err(damaged)?,
                _ => {}
            }
        }
        let Some(dynamic) = dynamic else {
            return Err(ElfError::NotDynamic {
                name: name.to_owned(),
            });
        };
        let symbols = sections
            .symbols(endian, data, SHT_DYNSYM)
            .map_err(damaged)?;
        for entry in dynamic {
            match entry.tag(endian) {
                DT_NEEDED => {
                    let bytes = entry.string(endian, symbols.strings()).map_err(damaged)?;
                    library.needed.push(text(bytes));
                }
                DT_SONAME => {
                    let bytes = entry.string(endian, symbols.strings()).map_err(damaged)?;
                    library.soname = Some(text(bytes));
                }
                DT_TEXTREL => library.text_relocations = true,
                DT_FLAGS => {
                    library.text_relocations |= entry.d_val(endian) & DF_TEXTREL.0 != 0;
                }
                _ => {}
            }
        }
        for symbol in symbols.iter() {
            let bytes = symbol.name(endian, symbols.strings()).map_err(damaged)?;
            if bytes.is_empty() || symbol.st_bind() == STB_LOCAL {
                continue;
            }
            let name = text(bytes);
            if symbol.is_undefined(endian) {
                library.undefined.insert(Undefined {
                    name,
                    weak: symbol.st_bind() == STB_WEAK,
                });
            } else {
                library.exports.insert(name);
            }
        }
        Ok(library)
    }

    /// Whether it is for the headset's processor.
    #[must_use]
    pub fn is_aarch64(&self) -> bool {
        self.machine == EM_AARCH64.0
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Every `lib....so` in the data. Texts of a Rust program follow one another without a mark between them, so a name ends at its
/// first `.so`. Words of four letters that a compiler keeps as numbers follow one another just so: what has capitals, in the middle
/// of a text, counts as those, except for Qualcomm's names.
fn named_libraries(data: &[u8]) -> BTreeSet<String> {
    const LONGEST: RangeInclusive<usize> = 7..=64;
    let mut found = BTreeSet::new();
    for end in memmem(data, b".so") {
        let begin = data[..end]
            .iter()
            .rposition(|byte| !(byte.is_ascii_alphanumeric() || b"_+-.".contains(byte)))
            .map_or(0, |before| before + 1);
        // A text that runs on from another one begins with the last `lib` in it.
        let run = &data[begin..end];
        if let Some(lib) = run.windows(3).rposition(|three| three == b"lib") {
            let name = &data[begin + lib..end + 3];
            let stands_alone = lib == 0;
            if LONGEST.contains(&name.len()) && (stands_alone || is_likely(&name[3..])) {
                found.insert(text(name));
            }
        }
    }
    found
}

/// Whether this, after `lib`, looks like a library's name rather than words that follow one another.
fn is_likely(name: &[u8]) -> bool {
    name.starts_with(b"Qnn") || !name.iter().any(u8::is_ascii_uppercase)
}

/// Where `needle` stands in `data`.
fn memmem<'a>(data: &'a [u8], needle: &'a [u8]) -> impl Iterator<Item = usize> + 'a {
    data.windows(needle.len())
        .enumerate()
        .filter(move |(_, window)| *window == needle)
        .map(|(at, _)| at)
}

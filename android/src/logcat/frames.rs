//! The stack of a panic as addresses within libraries: a packaged library has no names, which its symbols file has.

use std::ffi::{CStr, c_void};
use std::fmt;
use std::path::Path;

/// The most frames that are logged.
const MOST: usize = 64;

/// One frame of the stack.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Frame {
    /// The library that the code is in, by its file's name; nothing for code of no library.
    pub(super) library: Option<String>,
    /// Where in it, or in memory, the call stands: what `addr2line` takes.
    pub(super) address: usize,
}

impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let library = self.library.as_deref().unwrap_or("no library");
        write!(f, "{library} {:#x}", self.address)
    }
}

/// The calls that led here, the last first.
#[must_use]
pub(super) fn here() -> Vec<Frame> {
    let mut frames = Vec::with_capacity(MOST);
    backtrace::trace(|frame| {
        // In the newest frame it is the instruction itself, in all others the one after the call.
        let at = frame.ip().addr().saturating_sub(1);
        frames.push(of(at));
        frames.len() < MOST
    });
    frames
}

/// Where this library lies in memory.
#[must_use]
pub(super) fn this_library() -> Option<(String, usize)> {
    find((here as fn() -> Vec<Frame> as *const c_void).addr())
}

fn of(at: usize) -> Frame {
    match find(at) {
        Some((library, base)) => Frame {
            library: Some(library),
            address: at.wrapping_sub(base),
        },
        None => Frame {
            library: None,
            address: at,
        },
    }
}

/// The library that has an address, and where it begins.
fn find(at: usize) -> Option<(String, usize)> {
    let mut info = libc::Dl_info {
        dli_fname: std::ptr::null(),
        dli_fbase: std::ptr::null_mut(),
        dli_sname: std::ptr::null(),
        dli_saddr: std::ptr::null_mut(),
    };
    // SAFETY: dladdr takes any address, and writes nothing but this structure.
    let found = unsafe { libc::dladdr(std::ptr::without_provenance(at), &raw mut info) };
    if found == 0 || info.dli_fname.is_null() {
        return None;
    }
    // SAFETY: where dladdr has found a library, this is its name, which lasts as long as the library: those in which calls are
    // under way are not unloaded.
    let path = unsafe { CStr::from_ptr(info.dli_fname) }.to_string_lossy();
    let name = Path::new(&*path)
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    Some((
        name.unwrap_or_else(|| path.into_owned()),
        info.dli_fbase.addr(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_addresses_are_those_of_the_symbols() {
        let frames = here();
        assert!(frames.len() <= MOST, "bounded");
        let (library, base) = this_library().expect("a program has a file");
        let own = frames
            .iter()
            .filter(|frame| frame.library.as_ref() == Some(&library));
        let mut names = Vec::new();
        for frame in own {
            // The name that `addr2line` finds, found by the address in memory.
            let at = std::ptr::without_provenance_mut(base + frame.address);
            backtrace::resolve(at, |symbol| {
                names.extend(symbol.name().map(|name| name.to_string()));
            });
        }
        assert!(
            names
                .iter()
                .any(|name| name.contains("the_addresses_are_those_of_the_symbols")),
            "this test is in the backtrace: {names:?}"
        );
    }
}

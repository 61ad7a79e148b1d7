//! The check of ELF files: on libraries linked by Rust's own linker, good ones and ones with a defect each, and against another reader.

mod agreement;
mod defects;
mod fixture;
mod lists;

//! A good library, and one with each defect.

use android_native::elf::{ElfError, Fault, Library, Platform, check_library};

use crate::fixture::{Workshop, read, segment, workshop};

const ENTRY: [&str; 2] = ["ANativeActivity_onCreate", "android_main"];
const PT_LOAD: u32 = 1;
const PT_DYNAMIC: u32 = 2;

/// A good library, unless a test changes it.
fn good(shop: &Workshop) -> Vec<u8> {
    let called = ["pthread_create", "dlopen", "__android_log_write"];
    shop.link(
        "libmain.so",
        &ENTRY,
        &called,
        &["libc.so", "libdl.so", "liblog.so"],
        &["-znow"],
    )
}

fn faults(data: &[u8]) -> Vec<Fault> {
    check_library(
        &read("libmain.so", data),
        &[],
        &Platform::api_29(),
        Some(&ENTRY),
    )
}

#[test]
fn a_library_that_needs_only_androids_symbols_has_no_defect() {
    let Some(shop) = workshop() else { return };
    assert_eq!(faults(&good(&shop)), []);
}

#[test]
fn a_symbol_that_came_with_a_later_android_is_found() {
    let Some(shop) = workshop() else { return };
    // API 30, by its manual page in the platform's sources.
    let data = shop.link(
        "libmain.so",
        &ENTRY,
        &["memfd_create", "getpid"],
        &["libc.so"],
        &[],
    );
    assert_eq!(
        faults(&data),
        [Fault::Unresolved(vec!["memfd_create".to_owned()])]
    );
}

#[test]
fn a_symbol_of_a_library_that_is_not_asked_for_is_found() {
    let Some(shop) = workshop() else { return };
    let data = shop.link("libmain.so", &ENTRY, &["dlopen"], &["libc.so"], &[]);
    assert_eq!(
        faults(&data),
        [Fault::Unresolved(vec!["dlopen".to_owned()])]
    );
}

#[test]
fn a_library_that_android_does_not_have_is_found() {
    let Some(shop) = workshop() else { return };
    let data = shop.link("libmain.so", &ENTRY, &[], &["libgcc_s.so"], &[]);
    assert_eq!(faults(&data), [Fault::Needs("libgcc_s.so".to_owned())]);
}

#[test]
fn a_library_of_the_platform_without_a_list_is_refused() {
    let Some(shop) = workshop() else { return };
    let data = shop.link("libmain.so", &ENTRY, &[], &["libEGL.so"], &[]);
    assert_eq!(faults(&data), [Fault::NoList("libEGL.so".to_owned())]);
}

#[test]
fn a_library_beside_it_in_the_package_provides_its_exports_and_no_others() {
    let Some(shop) = workshop() else { return };
    let other = shop.link("libother.so", &["there"], &[], &[], &[]);
    let other = read("libother.so", &other);
    let platform = Platform::api_29();
    let check = |called: &[&str]| {
        let data = shop.link("libmain.so", &ENTRY, called, &["libother.so"], &[]);
        let library = read("libmain.so", &data);
        check_library(
            &library,
            std::slice::from_ref(&other),
            &platform,
            Some(&ENTRY),
        )
    };
    assert_eq!(check(&["there"]), []);
    assert_eq!(
        check(&["there", "elsewhere"]),
        [Fault::Unresolved(vec!["elsewhere".to_owned()])]
    );
}

#[test]
fn segments_for_pages_of_4_kib_are_found() {
    let Some(shop) = workshop() else { return };
    let data = shop.link("libmain.so", &ENTRY, &[], &[], &["-zmax-page-size=4096"]);
    assert_eq!(faults(&data), [Fault::Alignment(0x1000)]);
}

#[test]
fn a_segment_whose_place_does_not_fit_its_address_is_found() {
    let Some(shop) = workshop() else { return };
    let mut data = good(&shop);
    let (header, _) = segment(&data, PT_LOAD);
    // Its address, eight bytes after its place in the file.
    data[header + 17] ^= 0x10;
    assert_eq!(faults(&data), [Fault::Incongruent]);
}

#[test]
fn relocations_in_code_are_found() {
    let Some(shop) = workshop() else { return };
    let mut data = good(&shop);
    let (_, dynamic) = segment(&data, PT_DYNAMIC);
    let flags = (dynamic..)
        .step_by(16)
        .find(|at| data[*at..*at + 8] == 30_u64.to_le_bytes())
        .expect("DT_FLAGS, for it is bound at once");
    // DF_TEXTREL.
    data[flags + 8] |= 4;
    assert_eq!(faults(&data), [Fault::TextRelocations]);
}

#[test]
fn a_missing_entry_point_is_found() {
    let Some(shop) = workshop() else { return };
    let data = shop.link("libmain.so", &["android_main"], &[], &[], &[]);
    assert_eq!(
        faults(&data),
        [Fault::NoExport("ANativeActivity_onCreate".to_owned())]
    );
}

#[test]
fn an_entry_point_that_is_there_but_not_exported_is_found() {
    let Some(shop) = workshop() else { return };
    let versions = shop.path("versions");
    std::fs::write(
        &versions,
        "{ global: ANativeActivity_onCreate; local: *; };",
    )
    .expect("a file");
    let option = format!("--version-script={}", versions.display());
    let data = shop.link("libmain.so", &ENTRY, &[], &[], &[&option]);
    assert_eq!(faults(&data), [Fault::NoExport("android_main".to_owned())]);
}

#[test]
fn another_processor_and_another_kind_of_file_are_found() {
    let Some(shop) = workshop() else { return };
    let mut data = good(&shop);
    // e_machine: x86-64; e_type: a program.
    data[18] = 62;
    assert_eq!(faults(&data), [Fault::Machine(62)]);
    data[18] = 183;
    data[16] = 2;
    assert_eq!(faults(&data), [Fault::NotShared]);
}

#[test]
fn a_library_that_is_only_opened_by_name_is_looked_for_too() {
    let Some(shop) = workshop() else { return };
    let mut data = good(&shop);
    // Texts of a Rust program follow one another without a mark.
    data.extend(b"could not open libX11.solibvulkan.so or libmain.so");
    assert_eq!(faults(&data), [Fault::Opens("libX11.so".to_owned())]);
    // As a compiler keeps words of four letters.
    data.extend(b"dh_gZlibNodesaidnoneat_s.so.");
    assert_eq!(faults(&data), [Fault::Opens("libX11.so".to_owned())]);
    // Of others' libraries that is no fault: they name what they can do without.
    let library = read("libmain.so", &data);
    assert_eq!(check_library(&library, &[], &Platform::api_29(), None), []);
}

#[test]
fn no_damaged_file_makes_the_reader_panic() {
    let Some(shop) = workshop() else { return };
    let data = good(&shop);
    assert!(matches!(
        Library::read("libmain.so", b"not ELF at all"),
        Err(ElfError::NotElf { .. })
    ));
    for length in (0..data.len()).step_by(7) {
        // All that matters is that it returns.
        let _ = Library::read("libmain.so", &data[..length]);
    }
    for at in 0..data.len().min(0x400) {
        for value in [0, 0x7f, 0xff] {
            let mut broken = data.clone();
            broken[at] = value;
            let _ = Library::read("libmain.so", &broken);
        }
    }
}

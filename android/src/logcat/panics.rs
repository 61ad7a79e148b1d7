//! Panics, in the log before the process ends. The build for Android aborts on a panic, so this is the last log line.

use super::{frames, lines};
use std::backtrace::Backtrace;
use std::panic::{self, PanicHookInfo};
use std::sync::Once;

static ONCE: Once = Once::new();

/// Logs every panic, on every thread, with its backtrace. Setting it once is enough, also where an activity is made again in the same
/// process.
pub fn log_panics() {
    ONCE.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            tell(panic);
            before(panic);
        }));
    });
}

fn tell(panic: &PanicHookInfo<'_>) {
    let thread = std::thread::current();
    let thread = thread.name().unwrap_or("without a name");
    let message = panic.payload_as_str().unwrap_or("no message");
    let place = panic
        .location()
        .map_or_else(|| "an unknown place".to_owned(), ToString::to_string);
    log::error!("panic at {place} on the thread {thread}");
    for line in lines(message) {
        log::error!("{line}");
    }
    if let Some((library, base)) = frames::this_library() {
        log::error!("{library} is at {base:#x}; the stack, as addresses within libraries:");
    }
    for (number, frame) in frames::here().iter().enumerate() {
        log::error!("#{number:02} {frame}");
    }
    let names = Backtrace::force_capture().to_string();
    // A packaged library has none: its symbols file maps the addresses to names.
    if names.contains(module_path!()) {
        for line in lines(&names) {
            log::error!("{line}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use log::{Level, Log, Metadata, Record};
    use std::sync::Mutex;

    static HEARD: Mutex<Vec<(Level, String)>> = Mutex::new(Vec::new());

    struct Ear;

    impl Log for Ear {
        fn enabled(&self, _: &Metadata<'_>) -> bool {
            true
        }

        fn log(&self, record: &Record<'_>) {
            if record.level() == Level::Error && std::thread::current().name() == Some("doomed") {
                let line = (record.level(), record.args().to_string());
                HEARD.lock().expect("no panic here").push(line);
            }
        }

        fn flush(&self) {}
    }

    #[test]
    fn a_panic_is_logged_once_with_its_place_and_backtrace() {
        log::set_logger(&Ear).expect("no other logger");
        log::set_max_level(log::LevelFilter::Error);
        log_panics();
        log_panics();
        let doomed = std::thread::Builder::new().name("doomed".to_owned());
        let ended = doomed
            .spawn(|| panic!("first line\nsecond line"))
            .expect("a thread")
            .join();
        assert!(ended.is_err(), "it panicked");
        let heard = HEARD.lock().expect("no panic here").clone();
        let texts: Vec<&str> = heard.iter().map(|(_, text)| text.as_str()).collect();
        let place = file!().rsplit('/').next().expect("a name");
        assert!(
            texts[0].starts_with("panic at")
                && texts[0].contains(place)
                && texts[0].ends_with("the thread doomed"),
            "{}",
            texts[0]
        );
        assert_eq!(texts[1..3], ["first line", "second line"], "the message");
        assert!(
            texts[3..]
                .iter()
                .any(|line| line.contains("a_panic_is_logged_once")),
            "the backtrace names this test: {texts:?}"
        );
        let (library, base) = frames::this_library().expect("a program has a file");
        assert!(
            texts[3].starts_with(&format!("{library} is at {base:#x}")),
            "where it lies: {}",
            texts[3]
        );
        let first = format!("#00 {library} 0x");
        let addresses = texts.iter().filter(|line| line.starts_with(&first));
        assert_eq!(addresses.count(), 1, "addresses within it: {texts:?}");
        let firsts = texts.iter().filter(|line| line.starts_with("panic at"));
        assert_eq!(firsts.count(), 1, "the hook was set once");
    }
}

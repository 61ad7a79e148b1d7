//! The kernel's numbers of this process's threads, by their names.

use std::path::Path;

/// The threads of this process whose names begin with one of these; a kernel keeps the first 15 bytes of a name. None on a system that does not
/// tell.
#[must_use]
pub fn named(prefixes: &[&str]) -> Vec<i32> {
    named_in(Path::new("/proc/self/task"), prefixes)
}

fn named_in(tasks: &Path, prefixes: &[&str]) -> Vec<i32> {
    let Ok(tasks) = std::fs::read_dir(tasks) else {
        return Vec::new();
    };
    let mut found: Vec<i32> = tasks
        .filter_map(|task| {
            let task = task.ok()?;
            // A thread that ended meanwhile has no name any more.
            let name = std::fs::read_to_string(task.path().join("comm")).ok()?;
            let wanted = prefixes.iter().any(|prefix| name.starts_with(prefix));
            task.file_name().to_str()?.parse().ok().filter(|_| wanted)
        })
        .collect();
    found.sort_unstable();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn threads_are_found_by_how_their_names_begin() {
        let (stop, stopped) = channel::<()>();
        let thread = std::thread::Builder::new()
            .name("a lane of a test".to_owned())
            .spawn(move || _ = stopped.recv())
            .expect("a thread");
        let begun = std::time::Instant::now();
        // A thread names itself when it begins.
        while named(&["a lane"]).is_empty() && begun.elapsed().as_secs() < 10 {
            std::thread::yield_now();
        }
        assert_eq!(named(&["no such", "a lane"]).len(), 1, "the one");
        assert!(named(&["no such"]).is_empty(), "none");
        let own = i32::try_from(std::process::id()).expect("a number");
        assert!(named(&[""]).contains(&own), "the process's first thread");
        drop(stop);
        thread.join().expect("it ends");
        assert!(named_in(Path::new("/no/such"), &[""]).is_empty(), "nothing");
    }
}

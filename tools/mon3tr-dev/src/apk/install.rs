//! Onto the headset, by Android's debug bridge.

use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Android's own activity for native applications.
const ACTIVITY: &str = "android.app.NativeActivity";
/// Names one of several devices, for adb as for us.
const SERIAL: &str = "ANDROID_SERIAL";

/// A device that adb knows of, and whether it lets us in.
#[derive(Debug, PartialEq, Eq)]
struct Device {
    serial: String,
    state: String,
}

/// Installs `file` over what is there, and starts the application `package`.
pub(super) fn install(file: &Path, package: &str) -> anyhow::Result<()> {
    let adb = adb();
    let wanted = std::env::var(SERIAL)
        .ok()
        .filter(|serial| !serial.is_empty());
    let devices = parse_devices(&run(&adb, &["devices"])?);
    let serial = choose(&devices, wanted.as_deref())?;
    eprintln!("installing on {serial}");
    let path = file.display().to_string();
    let said = run(&adb, &["-s", serial, "install", "-r", &path])?;
    // Older ones end well whatever happened.
    if let Some(why) = said.lines().find(|line| line.contains("Failure")) {
        bail!(
            "the headset refused {path}: {}{}",
            why.trim(),
            advice(why, package)
        );
    }
    let activity = format!("{package}/{ACTIVITY}");
    let said = run(
        &adb,
        &["-s", serial, "shell", "am", "start", "-n", &activity],
    )?;
    if let Some(why) = said.lines().find(|line| line.starts_with("Error")) {
        bail!("{package} is installed, but did not start: {}", why.trim());
    }
    println!("installed on {serial} and started: put the headset on");
    Ok(())
}

/// What to do about a refusal, where there is something.
fn advice(why: &str, package: &str) -> String {
    if why.contains("INSTALL_FAILED_UPDATE_INCOMPATIBLE") {
        return format!(
            "; another key signed the one that is installed: adb uninstall {package}, and run this again"
        );
    }
    if why.contains("INSTALL_FAILED_INSUFFICIENT_STORAGE") {
        return "; the headset's storage is full".to_owned();
    }
    String::new()
}

/// On the path, or in the SDK that the environment names.
fn adb() -> PathBuf {
    let on_path = std::env::var_os("PATH").is_some_and(|path| {
        std::env::split_paths(&path).any(|folder| folder.join("adb").is_file())
    });
    if on_path {
        return "adb".into();
    }
    ["ANDROID_HOME", "ANDROID_SDK_ROOT"]
        .iter()
        .filter_map(std::env::var_os)
        .map(|sdk| Path::new(&sdk).join("platform-tools/adb"))
        .find(|adb| adb.is_file())
        .unwrap_or("adb".into())
}

fn run(adb: &Path, arguments: &[&str]) -> anyhow::Result<String> {
    let output = match Command::new(adb).args(arguments).output() {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => bail!(
            "there is no adb, which installs on headsets: apt-get install adb, or Android's platform-tools"
        ),
        Err(error) => return Err(error).context("adb could not be started"),
    };
    let said = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    // What a refused installation says is looked at by the caller.
    if !output.status.success() && !said.contains("Failure") {
        bail!("adb {} failed: {}", arguments.join(" "), said.trim());
    }
    Ok(said)
}

/// What `adb devices` lists: a serial number and a state a line, with blanks between, after a heading.
fn parse_devices(said: &str) -> Vec<Device> {
    said.lines()
        .skip_while(|line| !line.starts_with("List of devices"))
        .skip(1)
        .filter_map(|line| {
            let (serial, state) = line.split_once(char::is_whitespace)?;
            Some(Device {
                serial: serial.to_owned(),
                state: state.trim().to_owned(),
            })
        })
        .collect()
}

/// The one there is, or of several the one that is asked for.
fn choose<'a>(devices: &'a [Device], wanted: Option<&str>) -> anyhow::Result<&'a str> {
    let device = match (devices, wanted) {
        ([], _) => bail!(
            "adb sees no headset: switch on developer mode in Meta's phone app, and connect the headset by USB"
        ),
        (devices, Some(wanted)) => devices
            .iter()
            .find(|device| device.serial == wanted)
            .with_context(|| {
                format!(
                    "adb sees no headset {wanted} ({SERIAL}), only {}",
                    serials(devices)
                )
            })?,
        ([device], None) => device,
        (devices, None) => bail!(
            "adb sees several devices, {}: say which with {SERIAL}",
            serials(devices)
        ),
    };
    match device.state.as_str() {
        "device" => Ok(&device.serial),
        "unauthorized" => bail!(
            "the headset {} has not allowed this computer: put it on, and allow USB debugging",
            device.serial
        ),
        state => bail!(
            "the headset {} is {state}: unplug it, plug it in again, and run this again",
            device.serial
        ),
    }
}

fn serials(devices: &[Device]) -> String {
    let serials: Vec<&str> = devices
        .iter()
        .map(|device| device.serial.as_str())
        .collect();
    serials.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(serial: &str, state: &str) -> Device {
        Device {
            serial: serial.to_owned(),
            state: state.to_owned(),
        }
    }

    #[test]
    fn devices_are_read_after_whatever_adb_says_of_its_daemon() {
        let said = "* daemon not running; starting now at tcp:5037\n* daemon started successfully\nList of devices attached\n\
                    2G0YC1ZF7X0123\tdevice\n192.168.1.7:5555\tunauthorized\n\n";
        assert_eq!(
            parse_devices(said),
            [
                device("2G0YC1ZF7X0123", "device"),
                device("192.168.1.7:5555", "unauthorized")
            ]
        );
        assert_eq!(parse_devices("error: no daemon"), []);
    }

    #[test]
    fn one_headset_is_taken_and_of_several_the_one_that_is_named() {
        let one = [device("A", "device")];
        let two = [device("A", "device"), device("B", "device")];
        assert_eq!(choose(&one, None).ok(), Some("A"));
        assert_eq!(choose(&two, Some("B")).ok(), Some("B"));
        for (devices, wanted, word) in [
            (&two[..], None, "ANDROID_SERIAL"),
            (&two[..], Some("C"), "A, B"),
            (&[], None, "developer mode"),
            (&[device("A", "unauthorized")], None, "allow USB debugging"),
            (&[device("A", "offline")], None, "offline"),
        ] {
            let error = choose(devices, wanted)
                .expect_err("nothing to take")
                .to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}

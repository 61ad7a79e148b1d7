//! `adb` for the rehearsal as a device: hands its arguments to the driver, which answers as a headset's adb would.

use android_rehearsal::adb::{Answer, Question, SOCKET};
use anyhow::Context;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::process::ExitCode;

fn main() -> anyhow::Result<ExitCode> {
    let socket = std::env::var_os(SOCKET).with_context(|| {
        format!("{SOCKET} names no rehearsal: ./run rehearse-android --device starts one")
    })?;
    let stream = UnixStream::connect(socket).context("error: no devices/emulators found")?;
    let question = Question {
        arguments: std::env::args().skip(1).collect(),
        folder: std::env::current_dir()?,
    };
    writeln!(&stream, "{}", serde_json::to_string(&question)?)?;
    let mut line = String::new();
    BufReader::new(&stream).read_line(&mut line)?;
    let answer: Answer = serde_json::from_str(&line).context("the rehearsal has ended")?;
    if answer.status == 0 {
        print!("{}", answer.said);
    } else {
        eprint!("{}", answer.said);
    }
    Ok(ExitCode::from(answer.status))
}

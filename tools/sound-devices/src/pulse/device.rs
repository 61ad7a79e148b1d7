//! What a microphone and a loudspeaker have in common: a stream of the sound server's, lost and found again.

use crate::SoundError;
use crate::pulse::connection::{Connection, SoundServer};
use std::error::Error;
use std::time::{Duration, Instant};

/// Between two looks whether a device has come back.
const LOOKING: Duration = Duration::from_millis(500);

/// A kind of stream that a device gives or takes.
pub(crate) trait Stream: Sized {
    /// Of the device, as it is told.
    const KIND: &'static str;
    /// What a call does while the device is away.
    const WITHOUT: &'static str;

    /// What the server calls the device that is meant.
    fn choose(connection: &mut Connection, asked: Option<&str>) -> Result<String, SoundError>;

    /// Begins a stream of that device.
    fn begin(connection: Connection, name: &str) -> Result<Self, SoundError>;
}

/// A device of one kind, which may be away.
#[derive(Debug)]
pub(crate) struct Device<S> {
    server: SoundServer,
    asked: Option<String>,
    name: String,
    stream: Option<S>,
    /// When it is looked for again.
    look: Instant,
}

impl<S: Stream> Device<S> {
    /// The one of that name, or the server's own choice.
    ///
    /// # Errors
    /// If the server does not answer, or has no such device.
    pub(crate) fn open(server: &SoundServer, asked: Option<&str>) -> Result<Self, SoundError> {
        let (stream, name) = find(server, asked)?;
        Ok(Self {
            server: server.clone(),
            asked: asked.map(str::to_owned),
            name,
            stream: Some(stream),
            look: Instant::now(),
        })
    }

    /// What the server calls it.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Its stream, unless it is away.
    pub(crate) fn stream(&mut self) -> Option<&mut S> {
        self.stream.as_mut()
    }

    /// Its stream has failed: says so, and looks for it from now on.
    pub(crate) fn lose(&mut self, error: &SoundError) {
        log::warn!(
            "the {} {} is away ({}): {} until it is back",
            S::KIND,
            self.name,
            whole(error),
            S::WITHOUT
        );
        self.stream = None;
        self.look = Instant::now() + LOOKING;
    }

    /// Begins another stream instead of the present one.
    pub(crate) fn begin_anew(&mut self) {
        self.stream = None;
        match find(&self.server, self.asked.as_deref()) {
            Ok((stream, name)) => (self.stream, self.name) = (Some(stream), name),
            Err(error) => self.lose(&error),
        }
    }

    /// Looks whether it is back when that is due, and waits until then, but not past `until`. Returns at once while it is there.
    pub(crate) fn look(&mut self, until: Instant) {
        if self.stream.is_some() {
            return;
        }
        let now = Instant::now();
        if now < self.look {
            std::thread::sleep(self.look.min(until).saturating_duration_since(now));
            return;
        }
        match find(&self.server, self.asked.as_deref()) {
            Ok((stream, name)) => {
                log::info!("the {} {name} is back", S::KIND);
                (self.stream, self.name) = (Some(stream), name);
            }
            Err(error) => log::debug!("no {} yet: {}", S::KIND, whole(&error)),
        }
        self.look = Instant::now() + LOOKING;
    }
}

fn find<S: Stream>(server: &SoundServer, asked: Option<&str>) -> Result<(S, String), SoundError> {
    let mut connection = Connection::open(server)?;
    let name = S::choose(&mut connection, asked)?;
    Ok((S::begin(connection, &name)?, name))
}

/// An error with its causes: a line of the log is all that is told of it.
fn whole(error: &SoundError) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text = format!("{text}: {cause}");
        next = cause.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulseaudio::protocol::{ProtocolError, PulseError};

    #[test]
    fn an_error_is_told_with_its_causes_and_each_of_them_once() {
        let refused = SoundError::from(ProtocolError::ServerError(PulseError::AccessDenied));
        let lost = SoundError::from(std::io::Error::other("a pipe has burst"));
        let cut = ProtocolError::Io(std::io::Error::other("a pipe has burst"));
        let nonsense = ProtocolError::Invalid("a message of no length".to_owned());
        for (error, cause) in [
            (refused, "Access failure"),
            (lost, "a pipe has burst"),
            (cut.into(), "a pipe has burst"),
            (nonsense.into(), "a message of no length"),
        ] {
            let text = whole(&error);
            assert!(text.starts_with(&error.to_string()), "{text}");
            assert_eq!(text.matches(cause).count(), 1, "{text}");
        }
    }
}

//! Offers and answers (SDP, RFC 8866), read once and strictly into what a connection needs of them.
//!
//! What the WebRTC library gets is written from what was read and checked, and from nothing else: so the library sees
//! the certificate that was signed and the addresses that were screened, whatever its own reader takes for a line.
//! Attributes that a connection does not need are passed over.

mod candidate;
mod fingerprints;
mod lines;
mod part;

pub(crate) use candidate::{Candidate, Host};
pub(crate) use fingerprints::Fingerprints;
pub use lines::SdpError;
pub(crate) use lines::only;
pub(crate) use part::{Direction, Media, Part};

use lines::{Line, lines};
use link_protocol::Refusal;
use std::ops::RangeInclusive;

const NO_FINGERPRINT: SdpError = SdpError::Lacks("a certificate's fingerprint by SHA-256");

/// Sections of a description.
const MAX_PARTS: usize = 8;

/// What a side shows of itself: attributes of the whole session, each at most once.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Shown {
    pub(crate) link: Option<String>,
    pub(crate) key: Option<String>,
    pub(crate) permit: Option<String>,
    pub(crate) guest: Option<String>,
    pub(crate) name: Option<String>,
    /// The side's half of the agreement on the keys of what a forwarder hands on.
    pub(crate) exchange: Option<String>,
}

impl Shown {
    /// Those among `text`, which is of no connection.
    pub(crate) fn read(text: &str) -> Result<Self, SdpError> {
        let mut shown = Self::default();
        for line in lines(text)? {
            if let Some((name, value)) = line.attribute() {
                shown.take(line, name, value)?;
            }
        }
        Ok(shown)
    }

    /// Takes an attribute; whether it is one of these.
    fn take(&mut self, line: Line<'_>, name: &str, value: Option<&str>) -> Result<bool, SdpError> {
        let place = match name {
            "mon3tr-link" => &mut self.link,
            "mon3tr-key" => &mut self.key,
            "mon3tr-permit" => &mut self.permit,
            "mon3tr-guest" => &mut self.guest,
            "mon3tr-name" => &mut self.name,
            "mon3tr-exchange" => &mut self.exchange,
            _ => return Ok(false),
        };
        let value = value.ok_or_else(|| line.wrong("the attribute has no value"))?;
        set(line, place, value.to_owned())?;
        Ok(true)
    }
}

/// An offer or answer.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Description {
    pub(crate) shown: Shown,
    /// It is of a server's forwarder.
    pub(crate) is_of_forwarder: bool,
    /// The other side does not take this one.
    pub(crate) refusal: Option<Refusal>,
    fingerprints: Fingerprints,
    ice_name: Option<String>,
    ice_password: Option<String>,
    is_lite: bool,
    setup: Option<String>,
    bundle: Option<Vec<String>>,
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) parts: Vec<Part>,
}

impl Description {
    /// Reads `text`.
    ///
    /// # Errors
    /// If it is no description, or one that two readers might understand differently.
    pub(crate) fn read(text: &str) -> Result<Self, SdpError> {
        let lines = lines(text)?;
        let (first, rest) = lines.split_first().ok_or(SdpError::Lacks("any line"))?;
        if (first.kind, first.value) != (b'v', "0") {
            return Err(first.wrong("a description begins with `v=0`"));
        }
        let mut description = Self::default();
        for line in rest {
            description.take(*line)?;
        }
        description.check_names(*first)?;
        Ok(description)
    }

    fn take(&mut self, line: Line<'_>) -> Result<(), SdpError> {
        match line.kind {
            b'v' => return Err(line.wrong("there are two descriptions")),
            b'm' if self.parts.len() >= MAX_PARTS => {
                return Err(line.wrong("there are too many sections"));
            }
            b'm' => self.parts.push(Part::begin(line)?),
            _ => {}
        }
        let Some((name, value)) = line.attribute() else {
            return Ok(());
        };
        if self.take_of_connection(line, name, value)? {
            return Ok(());
        }
        match self.parts.last_mut() {
            Some(_) if name.starts_with("mon3tr-") => {
                Err(line.wrong("an attribute of the session is in a section"))
            }
            Some(part) => part.take(name, value).map_err(|why| line.wrong(why)),
            None => self.take_of_session(line, name, value),
        }
    }

    /// Takes an attribute that may be of the session or of a section, and is the same for the whole connection; whether
    /// it is one.
    fn take_of_connection(
        &mut self,
        line: Line<'_>,
        name: &str,
        value: Option<&str>,
    ) -> Result<bool, SdpError> {
        let ice = |value: &str, length| {
            let is_ice = is_ice_text(value, length);
            is_ice
                .then(|| value.to_owned())
                .ok_or_else(|| line.wrong("ICE's name or password is malformed"))
        };
        match (name, value) {
            ("fingerprint", Some(value)) => {
                self.fingerprints
                    .add(value)
                    .map_err(|why| line.wrong(why))?;
            }
            ("ice-ufrag", Some(value)) => agree(line, &mut self.ice_name, ice(value, 4..=256)?)?,
            ("ice-pwd", Some(value)) => agree(line, &mut self.ice_password, ice(value, 22..=256)?)?,
            ("setup", Some(value @ ("active" | "passive" | "actpass"))) => {
                agree(line, &mut self.setup, value.to_owned())?;
            }
            ("candidate", Some(value)) if !self.parts.is_empty() => {
                let candidate = Candidate::read(value);
                let candidate = candidate.ok_or_else(|| line.wrong("a candidate is malformed"))?;
                self.candidates.push(candidate);
            }
            ("fingerprint" | "ice-ufrag" | "ice-pwd" | "setup" | "candidate", _) => {
                return Err(line.wrong("the attribute's value is malformed, or it is of a section"));
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn take_of_session(
        &mut self,
        line: Line<'_>,
        name: &str,
        value: Option<&str>,
    ) -> Result<(), SdpError> {
        if self.shown.take(line, name, value)? {
            return Ok(());
        }
        match (name, value) {
            ("ice-lite", None) => self.is_lite = true,
            ("mon3tr-forwarder", None) if !self.is_of_forwarder => self.is_of_forwarder = true,
            ("mon3tr-forwarder", _) => return Err(line.wrong("the attribute is there twice")),
            ("mon3tr-refused", Some(why)) => set(line, &mut self.refusal, Refusal::of_word(why))?,
            ("group", Some(value)) => {
                if let Some(names) = value.strip_prefix("BUNDLE ") {
                    let names = names.split(' ').map(str::to_owned).collect();
                    set(line, &mut self.bundle, names)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Whether each section has a name of its own, and only those are bundled that are there.
    fn check_names(&self, line: Line<'_>) -> Result<(), SdpError> {
        let mut names: Vec<&String> = self
            .parts
            .iter()
            .filter_map(|part| part.mid.as_ref())
            .collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        let is_there = |name: &String| names.binary_search(&name).is_ok();
        if names.len() < count || !self.bundle.iter().flatten().all(is_there) {
            return Err(
                line.wrong("two sections have one name, or one is bundled that is not there")
            );
        }
        Ok(())
    }

    /// The certificate of the side that wrote it.
    ///
    /// # Errors
    /// If it names none.
    pub(crate) fn fingerprints(&self) -> Result<&Fingerprints, SdpError> {
        let named = Some(&self.fingerprints).filter(|it| it.is_complete());
        named.ok_or(NO_FINGERPRINT)
    }

    /// The side's ICE user fragment.
    ///
    /// # Errors
    /// If there is none.
    pub(crate) fn ice_name(&self) -> Result<&str, SdpError> {
        let name = self.ice_name.as_deref();
        name.ok_or(SdpError::Lacks("ICE's user fragment"))
    }

    /// What the WebRTC library gets, with these of the candidates.
    ///
    /// # Errors
    /// If no connection can be made of it.
    pub(crate) fn write<'a>(
        &self,
        candidates: impl IntoIterator<Item = &'a Candidate>,
    ) -> Result<String, SdpError> {
        let hash = self.fingerprints.sha_256().ok_or(NO_FINGERPRINT)?;
        let name = self.ice_name()?;
        let password = (self.ice_password.as_ref()).ok_or(SdpError::Lacks("ICE's password"))?;
        let setup = self.setup.as_ref().ok_or(SdpError::Lacks("a DTLS role"))?;
        let mut data = self
            .parts
            .iter()
            .filter(|part| part.media == Media::Data && part.is_used());
        if data.next().is_none() || data.next().is_some() {
            return Err(SdpError::Lacks("a section of data channels, or has two"));
        }
        let shared = format!(
            "a=ice-ufrag:{name}\r\na=ice-pwd:{password}\r\na=fingerprint:sha-256 {}\r\na=setup:{setup}\r\n",
            hash.to_ascii_uppercase()
        );
        let mut out = String::from("v=0\r\no=- 1 1 IN IP4 0.0.0.0\r\ns=-\r\nt=0 0\r\n");
        if self.is_lite {
            out.push_str("a=ice-lite\r\n");
        }
        if let Some(bundle) = &self.bundle {
            out.push_str(&format!("a=group:BUNDLE {}\r\n", bundle.join(" ")));
        }
        let candidates = candidates
            .into_iter()
            .map(|it| format!("a=candidate:{it}\r\n"));
        let candidates: String = candidates.collect();
        for part in &self.parts {
            out.push_str(&part.text(&shared));
            if part.media == Media::Data && part.is_used() {
                out.push_str(&candidates);
                out.push_str("a=end-of-candidates\r\n");
            }
        }
        Ok(out)
    }
}

/// Whether `text` is of RFC 8839's `ice-char`, and as long as that.
fn is_ice_text(text: &str, length: RangeInclusive<usize>) -> bool {
    let is_ice = |c: u8| c.is_ascii_alphanumeric() || matches!(c, b'+' | b'/');
    length.contains(&text.len()) && text.bytes().all(is_ice)
}

/// Whether `text` is a short name of letters, digits and a few signs.
fn is_token(text: &str) -> bool {
    let is_sign = |c: u8| c.is_ascii_alphanumeric() || matches!(c, b'-' | b'_' | b'.' | b'+');
    (1..=64).contains(&text.len()) && text.bytes().all(is_sign)
}

/// Keeps what is there once.
fn set<T>(line: Line<'_>, place: &mut Option<T>, value: T) -> Result<(), SdpError> {
    match place.replace(value) {
        Some(_) => Err(line.wrong("the attribute is there twice")),
        None => Ok(()),
    }
}

/// Keeps what has to be the same wherever it is.
fn agree<T: PartialEq>(line: Line<'_>, place: &mut Option<T>, value: T) -> Result<(), SdpError> {
    match place.replace(value) {
        Some(before) if place.as_ref() != Some(&before) => {
            Err(line.wrong("the sections of the description do not agree"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
pub(crate) mod tests;

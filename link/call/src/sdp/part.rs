//! One `m=` section of a description.

use super::lines::{Line, SdpError};

/// Formats of a section, and lines kept of each kind.
const MAX_FORMATS: usize = 64;

/// What a section is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Media {
    /// Data channels.
    Data,
    Audio,
    Video,
}

/// Who sends, as the description's writer sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    Both,
    Sends,
    Receives,
    Neither,
}

impl Direction {
    const NAMES: [(&str, Self); 4] = [
        ("sendrecv", Self::Both),
        ("sendonly", Self::Sends),
        ("recvonly", Self::Receives),
        ("inactive", Self::Neither),
    ];

    fn of(name: &str) -> Option<Self> {
        let known = Self::NAMES.into_iter().find(|(known, _)| *known == name);
        known.map(|(_, direction)| direction)
    }

    fn name(self) -> &'static str {
        let known = Self::NAMES.into_iter().find(|(_, it)| *it == self);
        known.map_or("", |(name, _)| name)
    }
}

/// What a payload type means.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RtpMap {
    pub(crate) payload_type: u8,
    pub(crate) codec: String,
    pub(crate) rate: u32,
    channels: Option<u8>,
}

impl RtpMap {
    fn read(value: &str) -> Option<Self> {
        let (number, codec) = value.split_once(' ')?;
        let mut parts = codec.split('/');
        let (codec, rate, channels) = (parts.next()?, parts.next()?, parts.next());
        let is_whole = super::is_token(codec) && parts.next().is_none();
        is_whole.then_some(Self {
            payload_type: payload_type(number)?,
            codec: codec.to_owned(),
            rate: rate.parse().ok()?,
            channels: channels.map(str::parse).transpose().ok()?,
        })
    }
}

fn payload_type(text: &str) -> Option<u8> {
    text.parse().ok().filter(|number| *number < 128)
}

/// A section.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Part {
    pub(crate) media: Media,
    port: u16,
    formats: Vec<u8>,
    pub(super) mid: Option<String>,
    pub(crate) direction: Option<Direction>,
    is_bundle_only: bool,
    is_multiplexed: bool,
    sctp_port: Option<u16>,
    max_message_size: Option<u32>,
    pub(crate) rtp_maps: Vec<RtpMap>,
    parameters: Vec<(u8, String)>,
    /// `SSRC ATTRIBUTE:VALUE`.
    sources: Vec<(u32, String)>,
    stream: Option<String>,
}

impl Part {
    /// The section that begins with this line.
    pub(super) fn begin(line: Line<'_>) -> Result<Self, SdpError> {
        let words: Vec<&str> = line.value.split(' ').collect();
        let [media, port, protocol, formats @ ..] = &*words else {
            return Err(line.wrong("a section has a medium, a port, a protocol and formats"));
        };
        let (media, formats) = match (*media, *protocol, formats) {
            ("application", "UDP/DTLS/SCTP", ["webrtc-datachannel"]) => {
                (Media::Data, Some(Vec::new()))
            }
            ("audio" | "video", "UDP/TLS/RTP/SAVPF", formats) => {
                let media = if *media == "audio" {
                    Media::Audio
                } else {
                    Media::Video
                };
                let formats = formats.iter().map(|text| payload_type(text));
                (media, formats.collect())
            }
            _ => {
                let why = "a section is of data channels, audio or video of WebRTC";
                return Err(line.wrong(why));
            }
        };
        let formats = formats.filter(|formats: &Vec<u8>| formats.len() <= MAX_FORMATS);
        let port = port.parse().ok();
        let (Some(formats), Some(port)) = (formats, port) else {
            return Err(line.wrong("the section's port or formats are no numbers, or too many"));
        };
        Ok(Self {
            media,
            port,
            formats,
            mid: None,
            direction: None,
            is_bundle_only: false,
            is_multiplexed: false,
            sctp_port: None,
            max_message_size: None,
            rtp_maps: Vec::new(),
            parameters: Vec::new(),
            sources: Vec::new(),
            stream: None,
        })
    }

    /// Whether the section is used: a refused one has port 0.
    pub(crate) fn is_used(&self) -> bool {
        self.port != 0 || self.is_bundle_only
    }

    /// Takes an attribute of the section; those that a connection does not need are passed over.
    pub(super) fn take(&mut self, name: &str, value: Option<&str>) -> Result<(), &'static str> {
        const WRONG: &str = "the attribute's value is malformed";
        const TWICE: &str = "the attribute is there twice";
        const MANY: &str = "the attribute is there too often";
        let is_new = match (name, value) {
            ("bundle-only", None) => !std::mem::replace(&mut self.is_bundle_only, true),
            ("rtcp-mux", None) => !std::mem::replace(&mut self.is_multiplexed, true),
            (name, None) => match Direction::of(name) {
                Some(direction) => self.direction.replace(direction).is_none(),
                None => true,
            },
            ("mid", Some(value)) => {
                let mid = super::is_token(value).then(|| value.to_owned());
                self.mid.replace(mid.ok_or(WRONG)?).is_none()
            }
            ("sctp-port", Some(value)) => self
                .sctp_port
                .replace(value.parse().map_err(|_| WRONG)?)
                .is_none(),
            ("max-message-size", Some(value)) => {
                let size: u64 = value.parse().map_err(|_| WRONG)?;
                let size = u32::try_from(size).unwrap_or(u32::MAX);
                self.max_message_size.replace(size).is_none()
            }
            ("rtpmap", Some(value)) => {
                let map = RtpMap::read(value).ok_or(WRONG)?;
                let is_new = self
                    .rtp_maps
                    .iter()
                    .all(|it| it.payload_type != map.payload_type);
                keep(&mut self.rtp_maps, map).ok_or(MANY)?;
                is_new
            }
            ("fmtp", Some(value)) => {
                let (number, text) = value.split_once(' ').ok_or(WRONG)?;
                let number = payload_type(number).ok_or(WRONG)?;
                let is_new = self.parameters.iter().all(|(it, _)| *it != number);
                keep(&mut self.parameters, (number, text.trim().to_owned())).ok_or(MANY)?;
                is_new
            }
            ("ssrc", Some(value)) => {
                let (number, text) = value.split_once(' ').ok_or(WRONG)?;
                let number = number.parse().map_err(|_| WRONG)?;
                let is_needed = ["cname:", "msid:"].iter().any(|it| text.starts_with(it));
                if is_needed {
                    keep(&mut self.sources, (number, text.trim().to_owned())).ok_or(MANY)?;
                }
                true
            }
            // One stream is enough.
            ("msid", Some(value)) => {
                self.stream.get_or_insert_with(|| value.trim().to_owned());
                true
            }
            _ => true,
        };
        if is_new { Ok(()) } else { Err(TWICE) }
    }

    /// The section as the library gets it, with `shared`, the lines that all sections of the description have.
    pub(super) fn text(&self, shared: &str) -> String {
        let port = self.port;
        let first = match self.media {
            Media::Data => format!("m=application {port} UDP/DTLS/SCTP webrtc-datachannel"),
            Media::Audio | Media::Video => {
                let media = if self.media == Media::Audio {
                    "audio"
                } else {
                    "video"
                };
                let formats = self.formats.iter().map(|format| format!(" {format}"));
                format!(
                    "m={media} {port} UDP/TLS/RTP/SAVPF{}",
                    formats.collect::<String>()
                )
            }
        };
        let mut out = format!("{first}\r\nc=IN IP4 0.0.0.0\r\n{shared}");
        let mut add = |attribute: String| out.push_str(&format!("a={attribute}\r\n"));
        self.mid.iter().for_each(|mid| add(format!("mid:{mid}")));
        self.direction
            .iter()
            .for_each(|it| add(it.name().to_owned()));
        if self.is_bundle_only {
            add("bundle-only".to_owned());
        }
        if self.is_multiplexed {
            add("rtcp-mux".to_owned());
        }
        self.sctp_port
            .iter()
            .for_each(|port| add(format!("sctp-port:{port}")));
        self.max_message_size
            .iter()
            .for_each(|size| add(format!("max-message-size:{size}")));
        for RtpMap {
            payload_type,
            codec,
            rate,
            channels,
        } in &self.rtp_maps
        {
            let channels = channels.map_or(String::new(), |count| format!("/{count}"));
            add(format!("rtpmap:{payload_type} {codec}/{rate}{channels}"));
        }
        for (number, text) in &self.parameters {
            add(format!("fmtp:{number} {text}"));
        }
        self.stream
            .iter()
            .for_each(|stream| add(format!("msid:{stream}")));
        for (number, text) in &self.sources {
            add(format!("ssrc:{number} {text}"));
        }
        out
    }
}

/// Keeps one more; nothing where there are as many as may be.
fn keep<T>(all: &mut Vec<T>, one: T) -> Option<()> {
    (all.len() < MAX_FORMATS).then(|| all.push(one))
}

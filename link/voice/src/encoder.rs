//! Samples to Opus packets.

use crate::{FRAME, MAX_PACKET_BYTES, RATE, VoiceError};
use bytes::Bytes;
use link_codec::Micros;
use ropus::{Application, Bitrate, Channels, Encoder, InbandFec};

/// Bits a second while a person speaks: wide-band speech without an audible artefact, with a coarse copy of each frame in the next one.
const BITRATE: u32 = 28_000;
/// Of 10: half the time of the highest for speech that sounds alike.
const COMPLEXITY: u8 = 5;
/// Percent of packets that the encoder expects to be lost: from there on it spends bits on the copies.
const EXPECTED_LOSS: u8 = 10;
/// So many packets tell of a silence: one of them may be lost.
const TELLINGS: u32 = 2;
/// Packets of so many bytes hold nothing but "silence goes on".
const SILENT_BYTES: usize = 2;

/// Encodes one person's voice.
pub struct VoiceEncoder {
    opus: Encoder,
    packet: [u8; MAX_PACKET_BYTES],
    /// The frame before was silent.
    silent: bool,
    /// Packets that have said so, since a person spoke last.
    told: u32,
}

impl std::fmt::Debug for VoiceEncoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VoiceEncoder")
            .field("silent", &self.silent)
            .finish_non_exhaustive()
    }
}

impl VoiceEncoder {
    /// For speech: in-band error correction, and hardly a packet while there is silence.
    ///
    /// # Errors
    /// If Opus refuses these settings.
    pub fn new() -> Result<Self, VoiceError> {
        let failed = |why: String| VoiceError::Encoder(why);
        let bitrate = Bitrate::try_bits(BITRATE).map_err(|error| failed(error.to_string()))?;
        let opus = Encoder::builder(RATE, Channels::Mono, Application::Voip)
            .bitrate(bitrate)
            .complexity(COMPLEXITY)
            .vbr(true)
            .inband_fec(InbandFec::Enabled)
            .packet_loss_perc(EXPECTED_LOSS)
            .dtx(true)
            .build()
            .map_err(|error| failed(error.to_string()))?;
        Ok(Self {
            opus,
            packet: [0; MAX_PACKET_BYTES],
            silent: false,
            told: 0,
        })
    }

    /// The packet of the next frame; `None` where silence goes on, which needs none: the first packets of a silence tell the decoder, and
    /// every 400 ms Opus refreshes its noise.
    ///
    /// # Errors
    /// If Opus refuses the frame.
    pub fn encode(&mut self, samples: &[f32; FRAME]) -> Result<Option<Bytes>, VoiceError> {
        let bytes = self
            .opus
            .encode_float(samples, &mut self.packet)
            .map_err(|error| VoiceError::Encode(error.to_string()))?;
        let packet = self.packet.get(..bytes).unwrap_or_default();
        let silent = is_silent(packet);
        if silent {
            self.told += 1;
        } else if !self.silent {
            // Two in a row are speech; a single one refreshes the noise.
            self.told = 0;
        }
        self.silent = silent;
        let is_sent = !silent || self.told <= TELLINGS;
        Ok(is_sent.then(|| Bytes::copy_from_slice(packet)))
    }

    /// When the first sample that a decoder makes of a frame's packet was captured, of a frame whose own first sample was captured at
    /// `spoken`: Opus looks ahead, so what it gives back is 6.5 ms older.
    #[must_use]
    pub fn captured(&self, spoken: Micros) -> Micros {
        let ahead = u64::from(self.opus.lookahead()) * 1_000_000 / u64::from(RATE);
        Micros(spoken.0.saturating_sub(ahead))
    }
}

/// Whether a packet says only that silence goes on.
pub(crate) fn is_silent(packet: &[u8]) -> bool {
    packet.len() <= SILENT_BYTES
}

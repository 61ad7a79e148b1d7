//! Samples to Opus packets.

use crate::{FRAME, MAX_PACKET_BYTES, RATE, VoiceError};
use bytes::Bytes;
use ropus::{Application, Bitrate, Channels, Encoder, InbandFec};

/// Bits a second while a person speaks: wide-band speech without an audible artefact, with a coarse copy of each frame in the next one.
const BITRATE: u32 = 28_000;
/// Of 10: half the time of the highest for speech that sounds alike.
const COMPLEXITY: u8 = 5;
/// Percent of packets that the encoder expects to be lost: from there on it spends bits on the copies.
const EXPECTED_LOSS: u8 = 10;
/// Packets of so many bytes hold nothing but "silence goes on".
const SILENT_BYTES: usize = 2;

/// Encodes one person's voice.
pub struct VoiceEncoder {
    opus: Encoder,
    packet: [u8; MAX_PACKET_BYTES],
    /// Whether the two frames before were silent, the last one first.
    silent: [bool; 2],
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
            silent: [false; 2],
        })
    }

    /// The packet of the next frame; `None` where silence goes on, which needs none: the first packet of a silence tells the decoder, and
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
        // A single packet between silent ones is a refreshment.
        let goes_on = silent && self.silent.contains(&true);
        self.silent = [silent, self.silent[0]];
        Ok((!goes_on).then(|| Bytes::copy_from_slice(packet)))
    }

    /// From a sample to the one that a decoder gives back for it, samples.
    #[must_use]
    pub fn look_ahead(&self) -> u32 {
        self.opus.lookahead()
    }
}

/// Whether a packet says only that silence goes on.
pub(crate) fn is_silent(packet: &[u8]) -> bool {
    packet.len() <= SILENT_BYTES
}

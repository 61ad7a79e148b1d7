//! Samples to Opus packets.

use crate::{FRAME, MAX_PACKET_BYTES, RATE, VoiceError};
use bytes::Bytes;
use link_codec::Micros;
use ropus::{Application, Bitrate, Channels, Encoder, InbandFec};

/// Bits a second while a person speaks: wide-band speech (RFC 6716, section 2.1.1) ...
const BITRATE: u32 = 16_000;
/// ... and with a coarse copy of each frame in the next one besides.
const BITRATE_WITH_COPIES: u32 = 24_000;
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
    copies: bool,
    /// Packets that have said so, since a person spoke last.
    told: u32,
}

impl std::fmt::Debug for VoiceEncoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VoiceEncoder")
            .field("told", &self.told)
            .finish_non_exhaustive()
    }
}

impl VoiceEncoder {
    /// For speech: in-band error correction, and hardly a packet while there is silence.
    ///
    /// # Errors
    /// If Opus refuses these settings.
    pub fn new() -> Result<Self, VoiceError> {
        let opus = Encoder::builder(RATE, Channels::Mono, Application::Voip)
            .bitrate(Bitrate::Bits(BITRATE_WITH_COPIES))
            .complexity(COMPLEXITY)
            .vbr(true)
            .inband_fec(InbandFec::Enabled)
            .packet_loss_perc(EXPECTED_LOSS)
            .dtx(true)
            .build()?;
        Ok(Self {
            opus,
            packet: [0; MAX_PACKET_BYTES],
            copies: true,
            told: 0,
        })
    }

    /// Whether each packet holds a coarse copy of the frame before, from the next packet on. At first it does. Without losses a copy is of no
    /// use, and takes a third of the bits.
    ///
    /// # Errors
    /// If Opus refuses these settings.
    pub fn set_copies(&mut self, copies: bool) -> Result<(), VoiceError> {
        if copies == self.copies {
            return Ok(());
        }
        let (fec, loss, bits) = if copies {
            (InbandFec::Enabled, EXPECTED_LOSS, BITRATE_WITH_COPIES)
        } else {
            (InbandFec::Disabled, 0, BITRATE)
        };
        self.opus.set_inband_fec(fec)?;
        self.opus.set_packet_loss_perc(loss)?;
        self.opus.set_bitrate(Bitrate::Bits(bits))?;
        self.copies = copies;
        Ok(())
    }

    /// The packet of the next frame; `None` where silence goes on, which needs none: the first packets of a silence tell the decoder, and
    /// every 400 ms Opus refreshes its noise.
    ///
    /// # Errors
    /// If Opus refuses the frame.
    pub fn encode(&mut self, samples: &[f32; FRAME]) -> Result<Option<Bytes>, VoiceError> {
        let bytes = self.opus.encode_float(samples, &mut self.packet)?;
        let packet = self.packet.get(..bytes).unwrap_or_default();
        let silent = is_silent(packet);
        if silent {
            self.told += 1;
        } else if is_active(packet) {
            // Others refresh the noise.
            self.told = 0;
        }
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

/// Whether the encoder found a voice in a packet's frame, or does not say: the first bit of SILK's part does (RFC 6716, section 4.2.3),
/// and CELT alone has none.
pub(crate) fn is_active(packet: &[u8]) -> bool {
    const CELT_ALONE: u8 = 0x80;
    const FRAMES: u8 = 0x03;
    match packet {
        [toc, ..] if toc & (CELT_ALONE | FRAMES) != 0 => true,
        [_, first, ..] => first & 0x80 != 0,
        _ => false,
    }
}

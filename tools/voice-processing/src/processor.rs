//! The microphone's side.

use crate::alignment::Alignment;
use crate::loud::Attenuator;
use crate::{FarEnd, PIECE, RATE};
use sonora::config::{
    AdaptiveDigital, EchoCanceller, GainController2, HighPassFilter, MaxProcessingRate,
    NoiseSuppression, NoiseSuppressionLevel, Pipeline,
};
use sonora::{AudioProcessing, Config, StreamConfig};
use std::time::{Duration, Instant};

/// Samples that are processed at a time: 20 ms, two pieces.
pub const FRAME: usize = 2 * PIECE;
/// What comes out was spoken so much before what goes in: the filters that split the voice into bands, and the canceller's blocks.
pub const DELAY: Duration = Duration::from_millis(10);

const PIECE_TIME: Duration = Duration::from_millis(10);

/// The limiter lets a sample be as large as full scale; this leaves 1 dB for what Opus makes of it.
const CEILING: f32 = 0.891_25;

/// Makes of what a microphone heard what should be sent.
pub struct VoiceProcessor {
    processing: AudioProcessing,
    far_end: Option<(FarEnd, Alignment)>,
    attenuator: Attenuator,
    reference: [f32; PIECE],
    /// What is written where nothing is to be written.
    unused: [f32; PIECE],
    piece: [f32; PIECE],
}

impl std::fmt::Debug for VoiceProcessor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VoiceProcessor")
            .field("far_end", &self.far_end)
            .finish_non_exhaustive()
    }
}

impl VoiceProcessor {
    /// Cancels the echo of `far_end`, where there is one; reduces noise and keeps the level in any case.
    #[must_use]
    pub fn new(far_end: Option<&FarEnd>) -> Self {
        let config = Config {
            pipeline: Pipeline {
                maximum_internal_processing_rate: MaxProcessingRate::Rate48kHz,
                ..Pipeline::default()
            },
            high_pass_filter: Some(HighPassFilter::default()),
            echo_canceller: far_end.map(|_| EchoCanceller::default()),
            noise_suppression: Some(NoiseSuppression {
                level: NoiseSuppressionLevel::High,
                ..NoiseSuppression::default()
            }),
            gain_controller2: Some(GainController2 {
                adaptive_digital: Some(AdaptiveDigital {
                    initial_gain_db: 0.0,
                    max_gain_db: 30.0,
                    ..AdaptiveDigital::default()
                }),
                ..GainController2::default()
            }),
            ..Config::default()
        };
        let stream = StreamConfig::new(RATE, 1);
        Self {
            processing: AudioProcessing::builder()
                .config(config)
                .capture_config(stream)
                .render_config(stream)
                .build(),
            far_end: far_end.map(|far_end| (far_end.clone(), Alignment::new())),
            attenuator: Attenuator::new(),
            reference: [0.0; PIECE],
            unused: [0.0; PIECE],
            piece: [0.0; PIECE],
        }
    }

    /// Processes 20 ms in place, of which the first sample was in the air at `spoken`. What comes out is [`DELAY`] older than what goes in.
    /// Samples that are no number are silence.
    pub fn process(&mut self, spoken: Instant, frame: &mut [f32; FRAME]) {
        let (pieces, _) = frame.as_chunks_mut::<PIECE>();
        let mut spoken = spoken;
        for piece in pieces {
            self.process_piece(spoken, piece);
            spoken += PIECE_TIME;
        }
    }

    fn process_piece(&mut self, spoken: Instant, piece: &mut [f32; PIECE]) {
        if let Some((far_end, alignment)) = &mut self.far_end {
            while let Some(played) = far_end.take() {
                alignment.play(&played);
            }
            alignment.reference(spoken, &mut self.reference);
            sanitise(&mut self.reference);
            let rendered = self
                .processing
                .process_render_f32(&[&self.reference], &mut [&mut self.unused]);
            debug_assert!(rendered.is_ok(), "the format is the one it was built for");
            // What is left of the delay is the canceller's to find.
            let _ = self.processing.set_stream_delay_ms(0);
        }
        sanitise(piece);
        let processed = self
            .processing
            .process_capture_f32(&[piece.as_slice()], &mut [&mut self.piece]);
        debug_assert!(processed.is_ok(), "the format is the one it was built for");
        self.attenuator.process(&mut self.piece);
        for (out, sample) in piece.iter_mut().zip(&self.piece) {
            *out = sample.clamp(-1.0, 1.0) * CEILING;
        }
    }
}

/// One sample that is no number would stay in the filters for ever.
fn sanitise(samples: &mut [f32; PIECE]) {
    for sample in samples {
        *sample = if sample.is_finite() {
            sample.clamp(-1.0, 1.0)
        } else {
            0.0
        };
    }
}

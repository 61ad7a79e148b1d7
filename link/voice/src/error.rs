/// Why there is no voice.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VoiceError {
    /// Opus refused its settings.
    #[error("the voice's encoder cannot be made")]
    Encoder(#[from] ropus::EncoderBuildError),
    /// Opus refused its settings.
    #[error("the voice's decoder cannot be made")]
    Decoder(#[from] ropus::DecoderInitError),
    /// Opus refused a frame.
    #[error("20 ms of voice cannot be encoded")]
    Encode(#[from] ropus::EncodeError),
}

/// Why there is no voice.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VoiceError {
    /// Opus refused its settings.
    #[error("the voice's encoder cannot be made: {0}")]
    Encoder(String),
    /// Opus refused its settings.
    #[error("the voice's decoder cannot be made: {0}")]
    Decoder(String),
    /// Opus refused a frame.
    #[error("20 ms of voice cannot be encoded: {0}")]
    Encode(String),
}

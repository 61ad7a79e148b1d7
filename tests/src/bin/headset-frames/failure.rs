//! The reasons why the program ends early.

use std::error::Error;
use std::fmt;

use renderer_openxr::error::XrError;
use renderer_splat::error::RenderError;
use serde_json::{Value, json};

#[derive(Debug)]
pub(crate) enum Failure {
    Xr(XrError),
    /// The runtime said that it is about to lose the session.
    Pending,
    /// It took too long.
    Late,
    /// A picture could not be written.
    Picture(image::ImageError),
}

impl Failure {
    pub(crate) fn is_loss(&self) -> bool {
        match self {
            Self::Xr(why) => why.is_loss(),
            Self::Pending => true,
            _ => false,
        }
    }

    pub(crate) fn may_pass(&self) -> bool {
        match self {
            Self::Xr(why) => why.may_pass(),
            Self::Pending => true,
            _ => false,
        }
    }

    /// As a line of output, with all causes.
    pub(crate) fn told(&self, event: &str) -> Value {
        let mut text = self.to_string();
        let mut cause = self.source();
        while let Some(error) = cause {
            text = format!("{text}: {error}");
            cause = error.source();
        }
        json!({
            "event": event,
            "error": text,
            "is_loss": self.is_loss(),
            "may_pass": self.may_pass(),
        })
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Xr(why) => why.fmt(f),
            Self::Pending => f.write_str("the runtime is about to lose the session"),
            Self::Late => f.write_str("the runtime keeps us waiting"),
            Self::Picture(why) => why.fmt(f),
        }
    }
}

impl Error for Failure {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Xr(why) => why.source(),
            Self::Picture(why) => why.source(),
            Self::Pending | Self::Late => None,
        }
    }
}

impl From<XrError> for Failure {
    fn from(why: XrError) -> Self {
        Self::Xr(why)
    }
}

impl From<RenderError> for Failure {
    fn from(why: RenderError) -> Self {
        Self::Xr(why.into())
    }
}

impl From<image::ImageError> for Failure {
    fn from(why: image::ImageError) -> Self {
        Self::Picture(why)
    }
}

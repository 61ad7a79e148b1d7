//! How large pictures are, and how many of them a frame has.

use clap::ValueEnum;

/// Width and height in pixels, written WxH.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
}

impl Size {
    /// The same shape, no side longer than `longest`.
    pub(crate) fn within(self, longest: u32) -> Self {
        let side = self.width.max(self.height);
        if side <= longest {
            return self;
        }
        let scaled = |length: u32| (length * longest / side).max(16);
        Self {
            width: scaled(self.width),
            height: scaled(self.height),
        }
    }
}

/// Of pictures for which no other size was asked for.
pub const DEFAULT_SIZE: Size = Size {
    width: 1024,
    height: 1024,
};

impl std::str::FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.parse::<u32>().ok().filter(|n| (16..=4096).contains(n));
        text.split_once('x')
            .and_then(|(w, h)| {
                Some(Self {
                    width: number(w)?,
                    height: number(h)?,
                })
            })
            .ok_or_else(|| {
                format!("{text} is not WIDTHxHEIGHT with sides of 16..4096 pixels, e.g. 1024x1024")
            })
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// One eye or two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Views {
    /// One view.
    Mono,
    /// One view for each eye, the left one first.
    Stereo,
}

impl Views {
    /// Views of a frame.
    pub fn count(self) -> u32 {
        match self {
            Self::Mono => 1,
            Self::Stereo => 2,
        }
    }
}

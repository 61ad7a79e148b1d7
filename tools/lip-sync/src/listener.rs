//! Listens to a voice and says what its mouth does.

use crate::front_end::{Decimator, FrontEnd, INPUTS};
use crate::network::{HIDDEN, Network, OUTPUTS, WeightsError};
use crate::{CLASSES, Mouth};

/// Share by which a mouth follows the newest window: lips need about 50 ms (two windows' constant, three to 80 %).
const FOLLOW: f32 = 0.45;
/// Loudness below the voice's level, natural logarithm of energy, at which the mouth is shut, and from which it is all open.
const SHUT: f32 = -5.5;
const OPEN: f32 = -1.5;

/// Hears 48 kHz sound.
#[derive(Debug)]
pub struct Listener {
    network: Network,
    decimator: Decimator,
    front: FrontEnd,
    seen: [f32; INPUTS],
    neurons: [f32; HIDDEN],
    mouth: Mouth,
}

impl Listener {
    /// A listener with the network that comes with this crate.
    ///
    /// # Errors
    /// If its weights are damaged.
    pub fn new() -> Result<Self, WeightsError> {
        Ok(Self {
            network: Network::built_in()?,
            decimator: Decimator::default(),
            front: FrontEnd::default(),
            seen: [0.0; INPUTS],
            neurons: [0.0; HIDDEN],
            mouth: Mouth::default(),
        })
    }

    /// Hears sound of 48 kHz, -1 to 1; the mouth after it. It is that of [`crate::front_end::AHEAD`] windows before the last sample.
    pub fn hear(&mut self, samples: &[f32]) -> Mouth {
        for sample in samples {
            let Some(sample) = self.decimator.push(*sample) else {
                continue;
            };
            if self.front.push(sample) {
                let probabilities = self.judge();
                self.follow(&probabilities);
            }
        }
        self.mouth
    }

    /// Forgets what was heard, and shuts the mouth.
    pub fn silence(&mut self) {
        self.decimator = Decimator::default();
        self.front = FrontEnd::default();
        self.mouth = Mouth::default();
    }

    fn judge(&mut self) -> [f32; OUTPUTS] {
        self.front.context(&mut self.seen);
        self.network.judge(&self.seen, &mut self.neurons)
    }

    fn follow(&mut self, probabilities: &[f32; CLASSES.len()]) {
        let loudness = self.front.judged().loudness;
        let part = ((loudness - SHUT) / (OPEN - SHUT)).clamp(0.0, 1.0);
        let loud = part * part * (3.0 - 2.0 * part);
        self.mouth = self.mouth.towards(&Mouth::of(probabilities, loud), FOLLOW);
    }
}

//! What the loudspeaker plays, on its way to the microphone's thread.

use crate::PIECE;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Pieces that may wait: half a second. A microphone takes them every 20 ms; where none does, older ones are of no use.
const WAITING: usize = 50;

/// 10 ms that were played, and when their first sample is heard.
pub(crate) type Played = (Instant, [f32; PIECE]);

/// What the loudspeaker plays: the far end of the call. Clones are of the same queue, one for the thread that plays and one for
/// [`VoiceProcessor::new`](crate::VoiceProcessor::new).
#[derive(Debug, Clone)]
pub struct FarEnd(Arc<Mutex<VecDeque<Played>>>);

impl Default for FarEnd {
    fn default() -> Self {
        Self(Arc::new(Mutex::new(VecDeque::with_capacity(WAITING))))
    }
}

impl FarEnd {
    /// Takes note that `piece` is played, and its first sample heard at `heard`. Pieces come in the order in which they are heard. Does not
    /// allocate; where nothing is taken, the oldest pieces go.
    pub fn play(&self, heard: Instant, piece: &[f32; PIECE]) {
        let mut waiting = self.waiting();
        if waiting.len() == WAITING {
            waiting.pop_front();
        }
        waiting.push_back((heard, *piece));
    }

    /// The oldest piece that waits. The lock is held for one copy only.
    pub(crate) fn take(&self) -> Option<Played> {
        self.waiting().pop_front()
    }

    /// A panic elsewhere leaves the queue as valid as it was.
    fn waiting(&self) -> MutexGuard<'_, VecDeque<Played>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn where_nothing_is_taken_the_oldest_pieces_go() {
        let (far_end, zero) = (FarEnd::default(), Instant::now());
        let player = far_end.clone();
        for number in 0..70u8 {
            let heard = zero + Duration::from_millis(10) * u32::from(number);
            player.play(heard, &[f32::from(number); PIECE]);
        }
        let taken: Vec<Played> = std::iter::from_fn(|| far_end.take()).collect();
        assert_eq!(taken.len(), WAITING, "as many as may wait");
        for ((heard, piece), number) in taken.iter().zip(20u8..) {
            assert_eq!(piece[0], f32::from(number), "the newest, in order");
            let due = zero + Duration::from_millis(10) * u32::from(number);
            assert_eq!(*heard, due, "with their times");
        }
    }
}

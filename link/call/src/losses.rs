//! Whether a viewer's network loses packets, by the viewer's feedback on motion: voice goes the same way, and is sent with copies against
//! losses only then.

use link_protocol::announcement::ChannelMode;
use link_protocol::data_channel::Feedback;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// A frame that has not arrived when so many later ones could have is lost; before, it may only be late.
const SETTLED: u32 = 16;
/// A feedback tells of so many frames before its newest one.
const TOLD: u32 = 64;
/// Frames over which the share of losses is averaged: four seconds at 30 Hz.
const AVERAGED: f32 = 128.0;
/// From this share of losses on copies are wanted, and below that one no longer. Between them are three standard deviations of the average
/// at 1 % lost, where single frames are concealed.
const MANY: f32 = 0.03;
const FEW: f32 = 0.01;
/// Frames whose fate is open: more than a feedback tells of.
const OPEN: usize = 128;

/// The share of motion frames that one viewer's network loses.
#[derive(Debug)]
struct LossMeter {
    /// Sequences of frames that were handed to the network, oldest first, whose fate is open.
    open: VecDeque<u32>,
    share: f32,
    is_lossy: bool,
}

impl LossMeter {
    /// Lossy until the first feedbacks say otherwise.
    fn new() -> Self {
        Self {
            open: VecDeque::with_capacity(OPEN),
            share: MANY,
            is_lossy: true,
        }
    }

    fn sent(&mut self, sequence: u32) {
        if self.open.len() == OPEN {
            self.open.pop_front();
        }
        self.open.push_back(sequence);
    }

    fn report(&mut self, feedback: Feedback) {
        while let Some(back) =
            (self.open.front()).and_then(|first| feedback.newest.checked_sub(*first))
        {
            if back < SETTLED {
                break;
            }
            self.open.pop_front();
            // What a feedback does not tell of is not known.
            if back <= TOLD {
                let arrived = (feedback.received >> (back - 1)) & 1 == 1;
                let lost = if arrived { 0.0 } else { 1.0 };
                self.share += (lost - self.share) / AVERAGED;
            }
        }
        self.is_lossy = self.share > if self.is_lossy { FEW } else { MANY };
    }
}

/// The viewers that want copies, of one sender. Voice is encoded once for all of them.
#[derive(Debug, Clone, Default)]
pub(crate) struct WantedCopies(Arc<AtomicUsize>);

impl WantedCopies {
    /// Whether any viewer wants them.
    pub(crate) fn any(&self) -> bool {
        self.0.load(Relaxed) > 0
    }

    /// For a viewer that begins.
    pub(crate) fn join(&self, mode: ChannelMode) -> ViewerLosses {
        self.0.fetch_add(1, Relaxed);
        ViewerLosses {
            // A reliable channel sends again what was lost: its feedback tells nothing of losses.
            meter: (mode == ChannelMode::Unreliable).then(LossMeter::new),
            wanted: self.clone(),
            wants: true,
        }
    }
}

/// One viewer's losses, and its say in [`WantedCopies`] while this is there.
#[derive(Debug)]
pub(crate) struct ViewerLosses {
    meter: Option<LossMeter>,
    wanted: WantedCopies,
    wants: bool,
}

impl ViewerLosses {
    /// A frame was handed to the network.
    pub(crate) fn sent(&mut self, sequence: u32) {
        if let Some(meter) = &mut self.meter {
            meter.sent(sequence);
        }
    }

    /// The viewer tells what has arrived.
    pub(crate) fn report(&mut self, feedback: Feedback) {
        if let Some(meter) = &mut self.meter {
            meter.report(feedback);
            let wants = meter.is_lossy;
            self.want(wants);
        }
    }

    fn want(&mut self, wants: bool) {
        match (self.wants, wants) {
            (false, true) => {
                self.wanted.0.fetch_add(1, Relaxed);
            }
            (true, false) => {
                self.wanted.0.fetch_sub(1, Relaxed);
            }
            _ => {}
        }
        self.wants = wants;
    }
}

impl Drop for ViewerLosses {
    fn drop(&mut self) {
        self.want(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use link_codec::Micros;
    use link_voice::{FRAME, VoiceEncoder};

    /// A viewer behind a network, with motion at 30 Hz and a feedback for every third frame that arrives.
    struct Network {
        losses: ViewerLosses,
        sequence: u32,
        arrived: Vec<bool>,
        random: fastrand::Rng,
    }

    impl Network {
        fn new(losses: ViewerLosses) -> Self {
            Self {
                losses,
                sequence: 0,
                arrived: Vec::new(),
                random: fastrand::Rng::with_seed(9),
            }
        }

        /// Sends a frame; a share of them is lost, and of the feedbacks too.
        fn frame(&mut self, lost: f32) {
            self.sequence += 1;
            self.losses.sent(self.sequence);
            self.arrived.push(self.random.f32() >= lost);
            let tells = self.sequence.is_multiple_of(3) && self.random.f32() >= lost;
            if !tells || self.arrived.last() != Some(&true) {
                return;
            }
            let before = self.arrived.iter().rev().skip(1).take(64).enumerate();
            let received = before.fold(0, |bits, (k, arrived)| bits | u64::from(*arrived) << k);
            self.losses.report(Feedback {
                newest: self.sequence,
                received,
                sent: Micros(0),
            });
        }

        fn frames(&mut self, number: u32, lost: f32) {
            for _ in 0..number {
                self.frame(lost);
            }
        }
    }

    #[test]
    fn copies_are_wanted_while_packets_are_lost_and_at_first() {
        let wanted = WantedCopies::default();
        assert!(!wanted.any(), "nobody is there");
        let mut network = Network::new(wanted.join(ChannelMode::Unreliable));
        network.frames(30, 0.0);
        assert!(wanted.any(), "one second is too short to tell");
        network.frames(300, 0.0);
        assert!(!wanted.any(), "nothing was lost for eleven seconds");
        network.frames(300, 0.1);
        assert!(wanted.any(), "a tenth is lost");
        // Frames that were never sent are no losses.
        network.frames(600, 0.0);
        for _ in 0..300 {
            network.sequence += 1;
            network.arrived.push(false);
            network.frame(0.0);
        }
        assert!(!wanted.any(), "every other frame was left out");
        network.frames(300, 0.1);
        assert!(wanted.any(), "a tenth is lost again");
        drop(network);
        assert!(!wanted.any(), "the viewer has left");
    }

    #[test]
    fn one_viewer_with_losses_is_enough_and_a_reliable_channel_may_have_any() {
        let wanted = WantedCopies::default();
        let mut clean = Network::new(wanted.join(ChannelMode::Unreliable));
        let mut reliable = Network::new(wanted.join(ChannelMode::Reliable));
        clean.frames(400, 0.0);
        reliable.frames(400, 0.0);
        assert!(wanted.any(), "of the reliable channel nothing is known");
        drop(reliable);
        assert!(!wanted.any(), "the other one loses nothing");
    }

    /// Whether a packet of one SILK frame holds a copy of the frame before: the second bit of SILK's part (RFC 6716, section 4.2.3).
    fn has_copy(packet: &[u8]) -> bool {
        matches!(packet, [toc, first, ..] if toc & 0x80 == 0 && first & 0x40 != 0)
    }

    #[test]
    fn voice_has_copies_on_a_lossy_network_and_none_on_a_clean_one() {
        for (lost, wanted_share) in [(0.0, 0.0..0.01), (0.05, 0.6..1.0)] {
            let wanted = WantedCopies::default();
            let mut network = Network::new(wanted.join(ChannelMode::Unreliable));
            let mut encoder = VoiceEncoder::new().expect("an encoder");
            let (mut packets, mut copies, mut bytes) = (0, 0, 0);
            for number in 0..1_500usize {
                // 50 packets to 30 frames of motion.
                network.frames(u32::from(number % 5 != 1 && number % 5 != 3), lost);
                encoder.set_copies(wanted.any()).expect("settings");
                let frame: [f32; FRAME] = std::array::from_fn(|k| {
                    let time = (number * FRAME + k) as f32 / 48e3;
                    let loud = 0.5 + 0.5 * (time * 20.0).sin();
                    (time * 900.0).sin() * (time * 3_100.0).sin() * 0.4 * loud
                });
                let packet = encoder.encode(&frame).expect("a packet");
                // The first seconds are sent with copies.
                if let Some(packet) = packet.filter(|_| number >= 500) {
                    packets += 1;
                    copies += u32::from(has_copy(&packet));
                    bytes += packet.len();
                }
            }
            let share = f64::from(copies) / f64::from(packets);
            println!("{lost} lost: {share} of {packets} with a copy, {bytes} bytes");
            assert!(packets > 500, "{packets} packets");
            assert!(wanted_share.contains(&share), "{lost} lost: {share}");
        }
    }
}

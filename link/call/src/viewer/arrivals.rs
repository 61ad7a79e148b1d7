//! What a viewer does with each message and each packet of voice.

use super::{Call, CallEvent, MAX_WAITING};
use crate::CallError;
use crate::session::{Arrived, Session};
use crate::voice_track::VoicePacket;
use bytes::Bytes;
use link_protocol::data_channel::{Message, State};
use link_voice::{Voice, timestamp};
use std::sync::atomic::Ordering::Relaxed;

/// What a message means for the connection that it came by.
pub(super) enum Handled {
    /// It goes on.
    Goes,
    /// The sender has hung up.
    Bye,
    /// Who sends it is not who should.
    Refused(CallError),
}

impl Call {
    /// Handles one message.
    pub(super) async fn handle(
        &mut self,
        session: &mut Session,
        bytes: Bytes,
        out: &mut Vec<u8>,
    ) -> Handled {
        self.with_statistics(|s| s.payload_bytes += bytes.len() as u64);
        let arrived = match session.read(bytes) {
            Ok(arrived) => arrived,
            Err(error) => return Handled::Refused(error),
        };
        match arrived {
            Arrived::Message(Message::Bye) => return Handled::Bye,
            Arrived::Message(Message::Pong(pong)) => {
                session.compare_clocks(pong, self.clock);
                self.with_statistics(|s| {
                    s.clock_offset_us = session.offset.offset_us();
                    s.round_trip_us = session
                        .offset
                        .round_trip()
                        .and_then(|time| u64::try_from(time.as_micros()).ok());
                });
            }
            Arrived::Message(Message::State(state)) => self.hear_of(session, state),
            Arrived::Message(Message::Forwarded { of }) => {
                // Who changes it again and again is not followed further than is taken.
                if self.waiting.load(Relaxed) < MAX_WAITING && session.follow(of) {
                    // Another sender's motion, or the same one's who came back: its sequences and times begin anew.
                    self.voice.begin_connection();
                    self.emit(CallEvent::Joined);
                }
            }
            Arrived::Unsealed => {
                if let Err(error) = self.meet(session.sender, session.person.clone()) {
                    return Handled::Refused(error);
                }
                self.voice.begin_connection();
                self.emit(CallEvent::Joined);
            }
            Arrived::Motion(message) => self.show(session, &message, out).await,
            Arrived::Message(Message::Feedback(_) | Message::Watching { .. })
            | Arrived::Nothing => {}
        }
        Handled::Goes
    }

    /// Takes what the sender tells of itself.
    fn hear_of(&mut self, session: &mut Session, State { person, sent }: State) {
        // Voice without motion needs the sender's time, too.
        session.newest_captured = session.newest_captured.max(Some(sent));
        // It comes again and again: one that finds no room is told the next time.
        if self.state != Some(person) && self.emit(CallEvent::State(person)) {
            self.state = Some(person);
        }
    }

    /// Takes a motion frame.
    async fn show(&mut self, session: &mut Session, message: &[u8], out: &mut Vec<u8>) {
        let arrived = self.clock.now();
        match session.decoder.decode(message) {
            Ok(frame) => {
                session.newest_captured = Some(frame.captured);
                let captured = session.offset.to_local(frame.captured);
                self.with_statistics(|s| s.frames += 1);
                self.emit(CallEvent::Frame {
                    frame,
                    captured,
                    arrived,
                });
                session.fresh_frames += 1;
                session.send_feedback(self.clock, out).await;
            }
            Err(error) => {
                self.with_statistics(|s| s.refused.add(error));
                log::debug!("a message of {} bytes: {error}", message.len());
            }
        }
    }

    /// Handles a packet of voice. It is no sign of life: a sender whose motion fails is joined again.
    pub(super) fn hear(&self, session: &mut Session, packet: VoicePacket) {
        let Some(VoicePacket { timestamp, opus }) = session.hear(packet) else {
            return;
        };
        // Motion tells the sender's time, of which a time stamp is only a part; the first of it comes before long.
        let Some(near) = session.newest_captured else {
            return;
        };
        self.with_statistics(|s| {
            s.voice += 1;
            s.voice_bytes += opus.len() as u64;
        });
        let captured = timestamp::to_time(timestamp, near);
        self.voice.push(Voice { captured, opus }, self.clock.now());
    }
}

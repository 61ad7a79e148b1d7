use super::*;
use proptest::prelude::*;

fn frame(sequence: u32, captured: u64) -> MotionFrame {
    MotionFrame {
        sequence,
        captured: Micros(captured),
        ..MotionFrame::default()
    }
}

fn taken(buffer: &mut JitterBuffer, now: u64) -> Vec<u32> {
    buffer.take(Micros(now)).map(|p| p.frame.sequence).collect()
}

/// The sender's clock is 7 s ahead; transit is 20 ms.
const AHEAD: u64 = 7_000_000;
const START: u64 = 1_000_000;

fn push(buffer: &mut JitterBuffer, sequence: u32, extra_us: u64) -> Arrival {
    let captured = START + u64::from(sequence) * 10_000;
    let arrived = Micros(captured + 20_000 + extra_us);
    buffer.push(
        frame(sequence, captured + AHEAD),
        arrived,
        Some(Micros(captured)),
    )
}

#[test]
fn frames_leave_in_order_and_duplicates_and_passed_ones_are_dropped() {
    let mut buffer = JitterBuffer::new();
    assert_eq!(push(&mut buffer, 1, 0), Arrival::InTime, "first");
    assert_eq!(push(&mut buffer, 3, 0), Arrival::InTime, "third");
    assert_eq!(push(&mut buffer, 2, 10_100), Arrival::Late, "second, late");
    assert_eq!(push(&mut buffer, 3, 200), Arrival::Duplicate, "third again");
    let now = START + 60_000;
    assert_eq!(taken(&mut buffer, now), [1, 2, 3], "all that is due");
    assert_eq!(push(&mut buffer, 3, 20_000), Arrival::Duplicate, "shown");
    assert_eq!(push(&mut buffer, 6, 0), Arrival::InTime, "sixth");
    assert_eq!(taken(&mut buffer, now + 60_000), [6], "the newest");
    assert_eq!(push(&mut buffer, 5, 30_000), Arrival::Passed, "fifth");
    let statistics = buffer.statistics();
    assert_eq!(statistics.received, 7, "received");
    assert_eq!(statistics.late, 1, "late");
    assert_eq!(statistics.reordered, 2, "reordered");
    assert_eq!(statistics.duplicate, 2, "duplicate");
    assert_eq!(statistics.passed, 1, "passed");
    assert_eq!(statistics.lost, 1, "the fourth never came");
}

#[test]
fn latency_is_told_as_network_and_buffer() {
    let mut buffer = JitterBuffer::new();
    push(&mut buffer, 1, 0);
    let now = START + 10_000 + 20_000 + 3_000;
    let played: Vec<_> = buffer.take(Micros(now)).collect();
    let timing = played.first().expect("it is due").timing;
    assert_eq!(timing.network_us(), Some(20_000), "network");
    assert_eq!(timing.buffer(), Duration::from_millis(3), "buffer");
    assert_eq!(timing.due, Micros(now - 3_000), "due on arrival");
}

#[test]
fn a_frame_waits_until_it_is_due() {
    let mut buffer = JitterBuffer::new();
    // Jitter of 0 and 8 ms in turn: the delay grows towards 8 ms.
    for sequence in 1..200 {
        push(&mut buffer, sequence, u64::from(sequence % 2) * 8_000);
        let due = START + u64::from(sequence) * 10_000 + 28_000;
        let _shown = taken(&mut buffer, due);
    }
    assert_eq!(buffer.delay(), Duration::from_millis(8), "delay");
    push(&mut buffer, 200, 0);
    let (_, due) = buffer.next().expect("one waits");
    assert_eq!(due, Micros(START + 2_000_000 + 28_000), "due");
    assert!(taken(&mut buffer, due.0 - 1).is_empty(), "not yet");
    assert_eq!(taken(&mut buffer, due.0), [200], "now");
}

#[test]
fn frames_wait_for_what_comes_later_and_no_longer_than_any_frame() {
    let mut buffer = JitterBuffer::new();
    push(&mut buffer, 1, 0);
    let own = buffer.offset_us().expect("there was a frame");
    // Something else is there 60 ms later: frames are due later by half of the time that passes, then with it.
    buffer.wait_for(Some(own + 60_000));
    let mut offsets = Vec::new();
    for sequence in 2..40 {
        push(&mut buffer, sequence, 0);
        offsets.push(buffer.offset_us().expect("there was a frame") - own);
        let _shown = taken(&mut buffer, START + u64::from(sequence) * 10_000);
    }
    assert_eq!(offsets[..3], [5_000, 10_000, 15_000], "{offsets:?}");
    assert_eq!(offsets[offsets.len() - 1], 60_000, "{offsets:?}");
    assert_eq!(
        buffer.delay(),
        Duration::from_millis(60),
        "it is part of the delay"
    );
    let (next, due) = buffer.next().expect("some wait");
    let wanted = next.captured.signed() + own + 60_000;
    assert_eq!(due.signed(), wanted, "due");
    // It is not waited for without end, nor when it is gone.
    buffer.wait_for(Some(i64::MAX));
    for sequence in 40..200 {
        push(&mut buffer, sequence, 0);
        let _shown = taken(&mut buffer, START + u64::from(sequence) * 10_000);
    }
    assert_eq!(buffer.delay(), JitterBuffer::MAX_DELAY, "the longest");
    buffer.wait_for(None);
    for sequence in 200..300 {
        push(&mut buffer, sequence, 0);
        let _shown = taken(&mut buffer, START + u64::from(sequence) * 10_000);
    }
    assert_eq!(buffer.offset_us(), Some(own), "as before");
}

#[test]
fn a_sender_that_begins_again_is_shown_after_reset() {
    let mut buffer = JitterBuffer::new();
    for sequence in 1..50 {
        push(&mut buffer, sequence, 0);
    }
    let _shown = taken(&mut buffer, START + 1_000_000);
    assert_eq!(push(&mut buffer, 1, 990_000), Arrival::Duplicate, "old run");
    buffer.reset();
    let arrived = START + 1_100_000;
    let outcome = buffer.push(frame(1, 5), Micros(arrived), None);
    assert_eq!(outcome, Arrival::InTime, "new run");
    assert_eq!(taken(&mut buffer, arrived), [1], "shown at once");
    assert_eq!(buffer.statistics().lost, 0, "nothing was lost");
}

proptest! {
    #[test]
    fn whatever_comes_memory_is_bounded_and_order_kept(
        frames in proptest::collection::vec(
            (prop_oneof![1u32..300, any::<u32>()], prop_oneof![0u64..5_000_000, any::<u64>()], 0u64..60_000, any::<bool>()),
            1..400,
        )
    ) {
        let mut buffer = JitterBuffer::new();
        let (mut now, mut shown, mut count) = (START, 0, 0u64);
        for (sequence, captured, step, take) in frames {
            now += step;
            buffer.push(frame(sequence, captured), Micros(now), None);
            count += 1;
            prop_assert!(buffer.waiting() <= WAITING, "{} frames wait", buffer.waiting());
            prop_assert!(buffer.delay() <= JitterBuffer::MAX_DELAY, "{:?}", buffer.delay());
            if let Some((_, due)) = buffer.next() {
                prop_assert!(due.0 <= now + 200_000, "due in {} us", due.0 - now);
            }
            if take {
                for played in buffer.take(Micros(now)) {
                    prop_assert!(played.frame.sequence > shown, "{} after {shown}", played.frame.sequence);
                    shown = played.frame.sequence;
                }
            }
        }
        let statistics = buffer.statistics();
        prop_assert_eq!(statistics.received, count, "every frame is counted");
    }
}

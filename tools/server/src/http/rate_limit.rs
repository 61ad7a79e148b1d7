//! Requests a second by address, by the generic cell rate algorithm (ATM Forum, Traffic Management 4.0, 4.4.2): of each address only
//! the time is kept at which the next of its requests would be due, if they came evenly.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use turn_server::network_prefix;

/// Requests a second by address.
#[derive(Debug)]
pub(crate) struct RateLimit {
    pace: Option<Pace>,
    due: Mutex<HashMap<IpAddr, Instant>>,
}

/// A rate with a burst.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Between two requests that come evenly.
    interval: Duration,
    /// How far requests may run ahead of that.
    ahead: Duration,
}

impl Pace {
    /// One request each `interval` in the long run, `burst` at once.
    pub(super) const fn new(interval: Duration, burst: u32) -> Self {
        Self {
            interval,
            ahead: interval.saturating_mul(burst.saturating_sub(1)),
        }
    }

    /// Admits a request at `now`, and moves `due`, the time at which the next one would be due; or returns how long to
    /// wait.
    pub(super) fn take(self, due: &mut Instant, now: Instant) -> Result<(), Duration> {
        *due = (*due).max(now);
        let early = due.duration_since(now);
        if early > self.ahead {
            return Err(early.saturating_sub(self.ahead));
        }
        *due += self.interval;
        Ok(())
    }
}

/// Whole seconds that are no shorter than `wait`, for `Retry-After`.
pub(super) fn retry_after_s(wait: Duration) -> u32 {
    u32::try_from(wait.as_secs()).unwrap_or(u32::MAX - 1) + 1
}

impl RateLimit {
    /// `per_second` of 0 is no limit.
    pub(crate) fn new(per_second: u32, burst: u32) -> Self {
        let pace = (per_second > 0).then(|| {
            let burst = if burst > 0 { burst } else { per_second };
            Pace::new(Duration::from_secs(1) / per_second, burst)
        });
        Self {
            pace,
            due: Mutex::default(),
        }
    }

    /// Seconds to wait, if this address asks too fast.
    pub(super) fn check(&self, address: IpAddr) -> Result<(), u32> {
        self.check_at(address, Instant::now())
    }

    fn check_at(&self, address: IpAddr, now: Instant) -> Result<(), u32> {
        let Some(pace) = self.pace else {
            return Ok(());
        };
        let mut all = self.due.lock().unwrap_or_else(PoisonError::into_inner);
        let due = all.entry(network_prefix(address)).or_insert(now);
        pace.take(due, now).map_err(retry_after_s)
    }

    /// Does not count one request of this address, which was checked before.
    pub(super) fn give_back(&self, address: IpAddr) {
        let Some(pace) = self.pace else {
            return;
        };
        let mut all = self.due.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(due) = all.get_mut(&network_prefix(address)) {
            *due = due.checked_sub(pace.interval).unwrap_or(*due);
        }
    }

    /// Forgets addresses that have been quiet.
    pub(crate) fn forget_quiet(&self) {
        let now = Instant::now();
        let mut all = self.due.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|_, due| *due > now);
        all.shrink_to_fit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    const HERE: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

    #[test]
    fn a_burst_is_let_through_and_then_so_many_a_second() {
        let limit = RateLimit::new(4, 3);
        let begun = Instant::now();
        let at = |ms| limit.check_at(HERE, begun + Duration::from_millis(ms));
        assert_eq!([at(0), at(0), at(0)], [Ok(()); 3], "the burst");
        assert_eq!(at(0), Err(1), "one more");
        assert_eq!(at(249), Err(1), "too early by a millisecond");
        assert_eq!([at(250), at(250)], [Ok(()), Err(1)], "one each 250 ms");
        assert_eq!(at(60_000), Ok(()), "a quiet minute");
        assert_eq!(
            [at(60_000), at(60_000), at(60_000)],
            [Ok(()), Ok(()), Err(1)],
            "the burst again, and no more for being quiet"
        );
    }

    #[test]
    fn addresses_do_not_count_for_one_another_and_quiet_ones_are_forgotten() {
        let limit = RateLimit::new(1000, 1);
        let now = Instant::now();
        let other = IpAddr::V4(Ipv4Addr::BROADCAST);
        let both = [HERE, other].map(|address| limit.check_at(address, now));
        assert_eq!(both, [Ok(()); 2], "one each");
        assert_eq!(limit.check_at(HERE, now), Err(1), "and no second one");
        std::thread::sleep(Duration::from_millis(2));
        limit.forget_quiet();
        let left = limit.due.lock().unwrap_or_else(PoisonError::into_inner);
        assert!(left.is_empty(), "forgotten: {left:?}");
    }

    #[test]
    fn requests_that_are_given_back_do_not_count() {
        let limit = RateLimit::new(1, 3);
        let now = Instant::now();
        for _ in 0..100 {
            assert_eq!(limit.check_at(HERE, now), Ok(()));
            limit.give_back(HERE);
        }
        let four = [(); 4].map(|()| limit.check_at(HERE, now));
        assert_eq!(
            four,
            [Ok(()), Ok(()), Ok(()), Err(2)],
            "the burst, and no more"
        );
    }

    #[test]
    fn no_limit_is_no_limit() {
        let limit = RateLimit::new(0, 0);
        let now = Instant::now();
        for _ in 0..10_000 {
            assert_eq!(limit.check_at(HERE, now), Ok(()), "let through");
        }
    }
}

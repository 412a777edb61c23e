//! The virtual time of the simulated arms: at the speed of real time, at another speed, step by step, or in lockstep with
//! the client.
//!
//! | mode | virtual time |
//! | --- | --- |
//! | a factor | passes at this speed, as long as the computer is fast enough |
//! | max | goes from event to event without sleeping |
//! | paused | does not pass |
//! | advance | goes from event to event until the end of the advance, then the previous mode continues |
//! | lockstep | goes from event to event while a byte is on the host line, and does not pass otherwise; after each timeout of real time without a byte it goes on by a millisecond |

use protocol_core::time::{Duration, Instant};
use rustix::event::Timespec;

use crate::clock::{RealClock, sleep_until};

/// Virtual time never goes on by more than this at once, so that the port is served in between.
const LONGEST_STEP: Duration = Duration::from_millis(1_000);
/// In lockstep, virtual time goes on by this after a timeout.
const LOCKSTEP_TICK: Duration = Duration::from_millis(1);
/// The slowest and the fastest factor, in thousandths.
const FACTORS: core::ops::RangeInclusive<u32> = 1..=1_000_000;

/// The speed of virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeSpeed {
    /// This many thousandths of the speed of real time.
    Thousandths(u32),
    /// As fast as possible.
    Max,
}

/// The clock of the arms.
#[derive(Debug)]
pub struct VirtualClock {
    real: RealClock,
    /// Real time at the last call of [`VirtualClock::tick`].
    real_now: Instant,
    now: Instant,
    /// Virtual time that is not part of `now` yet, in nanoseconds.
    rest_nanos: u64,
    speed: TimeSpeed,
    is_paused: bool,
    /// Virtual time goes from event to event until this time.
    advance_until: Instant,
    lockstep: Option<ClientLockstep>,
    /// Several arms share this clock.
    is_shared: bool,
}

#[derive(Debug)]
struct ClientLockstep {
    timeout: Duration,
    /// The real time of the last byte on the host line, or of the last timeout.
    since: Instant,
}

impl Default for VirtualClock {
    fn default() -> Self {
        Self {
            real: RealClock::default(),
            real_now: Instant::ZERO,
            now: Instant::ZERO,
            rest_nanos: 0,
            speed: TimeSpeed::Thousandths(1_000),
            is_paused: false,
            advance_until: Instant::ZERO,
            lockstep: None,
            is_shared: false,
        }
    }
}

impl VirtualClock {
    /// A clock in lockstep with the client. Virtual time starts at `start`. `timeout` is real time.
    #[must_use]
    pub fn in_lockstep(start: Instant, timeout: Duration) -> Self {
        let lockstep = Some(ClientLockstep { timeout, since: Instant::ZERO });
        Self { now: start, lockstep, ..Self::default() }
    }

    /// The virtual time after the last [`VirtualClock::tick`] or [`VirtualClock::set_now`].
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Advances the clock, and returns the virtual time. `due` is the next event of an arm. `is_busy`: a byte is on the host
    /// line. Must be called at least once a second.
    pub fn tick(&mut self, due: Instant, is_busy: bool) -> Instant {
        let real = self.real.now();
        self.tick_at(real, due, is_busy)
    }

    fn tick_at(&mut self, real: Instant, due: Instant, is_busy: bool) -> Instant {
        let elapsed = real - self.real_now;
        self.real_now = real;
        let next_event = due.max(self.now + Duration::from_micros(1)).min(self.now + LONGEST_STEP);
        self.now = if self.now < self.advance_until {
            next_event.min(self.advance_until)
        } else if self.is_paused {
            self.now
        } else if let Some(lockstep) = &mut self.lockstep {
            lockstep.tick(real, self.now, is_busy.then_some(next_event))
        } else {
            match self.speed {
                TimeSpeed::Max => next_event,
                TimeSpeed::Thousandths(factor) => self.after(elapsed, factor),
            }
        };
        self.now
    }

    /// The virtual time after this much real time.
    fn after(&mut self, elapsed: Duration, factor: u32) -> Instant {
        let nanos = elapsed.as_micros().saturating_mul(factor.into()) + self.rest_nanos;
        self.rest_nanos = nanos % 1_000;
        self.now + Duration::from_micros(nanos / 1_000).min(LONGEST_STEP)
    }

    /// How long the loop may sleep, in real time. The arguments are as for [`VirtualClock::tick`].
    #[must_use]
    pub fn sleep(&self, due: Instant, is_busy: bool) -> Timespec {
        let left = if self.now < self.advance_until {
            Duration::ZERO
        } else if self.is_paused {
            LONGEST_STEP
        } else if let Some(lockstep) = &self.lockstep {
            if is_busy { Duration::ZERO } else { lockstep.since + lockstep.timeout - self.real_now }
        } else {
            match self.speed {
                TimeSpeed::Max => Duration::ZERO,
                TimeSpeed::Thousandths(factor) => {
                    let virtual_time = (due - self.now).min(LONGEST_STEP).as_micros();
                    Duration::from_micros((virtual_time * 1_000).div_ceil(u64::from(factor.max(1))))
                }
            }
        };
        sleep_until(self.real_now, self.real_now + left)
    }

    /// Stops virtual time, or lets it go on.
    ///
    /// # Errors
    /// Virtual time follows the client.
    pub fn pause(&mut self, is_paused: bool) -> Result<(), FollowsClient> {
        self.check()?;
        self.is_paused = is_paused;
        Ok(())
    }

    /// Sets the speed. Ends a pause.
    ///
    /// # Errors
    /// Virtual time follows the client.
    pub fn set_speed(&mut self, speed: TimeSpeed) -> Result<(), FollowsClient> {
        self.check()?;
        self.speed = speed;
        self.is_paused = false;
        Ok(())
    }

    fn check(&self) -> Result<(), FollowsClient> {
        if self.lockstep.is_some() { Err(FollowsClient) } else { Ok(()) }
    }

    /// Lets the next ticks pass this much virtual time as fast as possible. Returns the virtual time at its end.
    pub fn advance(&mut self, time: Duration) -> Instant {
        let end = self.now + time;
        self.advance_until = self.advance_until.max(end);
        end
    }

    /// Sets whether several arms share this clock.
    pub const fn set_shared(&mut self, is_shared: bool) {
        self.is_shared = is_shared;
    }

    /// Do several arms share this clock?
    #[must_use]
    pub const fn is_shared(&self) -> bool {
        self.is_shared
    }

    /// Sets virtual time, forward or back. An advance that has not ended goes on to the same end.
    pub fn set_now(&mut self, now: Instant) {
        if self.advance_until <= self.now {
            self.advance_until = Instant::ZERO;
        }
        self.now = now;
        self.rest_nanos = 0;
    }

    /// The speed; `None` during a pause.
    #[must_use]
    pub const fn speed(&self) -> Option<TimeSpeed> {
        if self.is_paused { None } else { Some(self.speed) }
    }

    /// Does virtual time follow the client?
    #[must_use]
    pub const fn is_in_lockstep(&self) -> bool {
        self.lockstep.is_some()
    }
}

impl ClientLockstep {
    /// The virtual time after this tick. `next_event` is `None` if no byte is on the host line.
    fn tick(&mut self, real: Instant, now: Instant, next_event: Option<Instant>) -> Instant {
        match next_event {
            Some(event) => {
                self.since = real;
                event
            }
            None if real - self.since >= self.timeout => {
                self.since = real;
                now + LOCKSTEP_TICK
            }
            None => now,
        }
    }
}

impl TimeSpeed {
    /// The speed of real time, times this factor from 0.001 to 1000. `None` for another factor.
    #[must_use]
    pub fn times(factor: f64) -> Option<Self> {
        let thousandths = (factor * 1_000.0).round();
        let range = f64::from(*FACTORS.start())..=f64::from(*FACTORS.end());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the range")]
        range.contains(&thousandths).then_some(Self::Thousandths(thousandths as u32))
    }
}

/// The pause or speed cannot be set, because virtual time follows the client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("virtual time follows the client, because host-sim runs with --lockstep")]
pub struct FollowsClient;

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    fn sleep_micros(clock: &VirtualClock, due: Instant, is_busy: bool) -> i64 {
        let sleep = clock.sleep(due, is_busy);
        sleep.tv_sec * 1_000_000 + sleep.tv_nsec / 1_000
    }

    #[test]
    fn a_factor_scales_time_and_the_sleep() {
        let mut clock = VirtualClock::default();
        assert_eq!(clock.tick_at(at(10), at(50), false), at(10));
        clock.set_speed(TimeSpeed::times(50.0).unwrap()).unwrap();
        assert_eq!(clock.tick_at(at(12), at(500), false), at(110));
        assert_eq!(sleep_micros(&clock, at(210), false), 2_000);
        assert_eq!(clock.tick_at(at(1_012), at(500), false), at(1_110), "a second at most");
        clock.set_speed(TimeSpeed::times(0.001).unwrap()).unwrap();
        for real in 1_013..=1_112 {
            clock.tick_at(at(real), at(9_999), false);
        }
        assert_eq!(clock.now().as_micros(), 1_110_100, "no rounding error adds up");
        assert_eq!(TimeSpeed::times(1_001.0), None);
        assert_eq!([0.0, -1.0, f64::NAN].map(TimeSpeed::times), [None; 3]);
    }

    #[test]
    fn at_full_speed_time_goes_from_event_to_event() {
        let mut clock = VirtualClock::default();
        clock.set_speed(TimeSpeed::Max).unwrap();
        assert_eq!(clock.tick_at(at(0), at(50), false), at(50));
        assert_eq!(sleep_micros(&clock, at(100), false), 0);
        assert_eq!(clock.tick_at(at(0), at(60), false), at(60));
        assert_eq!(clock.tick_at(at(0), Instant::FAR_FUTURE, false), at(1_060), "a second at most");
        assert!(clock.tick_at(at(0), at(5), false) > at(1_060), "it never stands");
    }

    #[test]
    fn an_advance_ends_exactly_and_a_pause_continues() {
        let mut clock = VirtualClock::default();
        clock.pause(true).unwrap();
        assert_eq!(clock.tick_at(at(900), at(50), false), at(0));
        assert_eq!(sleep_micros(&clock, at(50), false), 500_000);
        assert_eq!(clock.advance(Duration::from_millis(70)), at(70));
        assert_eq!(sleep_micros(&clock, at(50), false), 0);
        assert_eq!(clock.tick_at(at(900), at(50), false), at(50));
        assert_eq!(clock.tick_at(at(900), at(100), false), at(70));
        assert_eq!((clock.tick_at(at(990), at(100), false), clock.speed()), (at(70), None));
        clock.pause(false).unwrap();
        assert_eq!(clock.tick_at(at(995), at(100), false), at(75), "the pause is not made up for");
    }

    #[test]
    fn time_can_be_set_back() {
        let mut clock = VirtualClock::default();
        clock.pause(true).unwrap();
        clock.advance(Duration::from_millis(70));
        clock.tick_at(at(10), at(100), false);
        clock.set_now(at(20));
        assert_eq!(clock.tick_at(at(11), at(100), false), at(20), "the advance was over");
        clock.advance(Duration::from_millis(70));
        clock.tick_at(at(12), at(30), false);
        clock.set_now(at(5));
        assert_eq!(clock.tick_at(at(13), at(100), false), at(90), "the advance goes on to its end");
    }

    #[test]
    fn in_lockstep_time_stands_while_the_host_line_is_idle() {
        let mut clock = VirtualClock::in_lockstep(at(1_000), Duration::from_millis(100));
        assert_eq!(clock.tick_at(at(50), at(1_050), false), at(1_000));
        assert_eq!(sleep_micros(&clock, at(1_050), false), 50_000);
        assert_eq!(clock.tick_at(at(60), at(1_002), true), at(1_002));
        assert_eq!(clock.tick_at(at(159), at(1_010), false), at(1_002));
        assert_eq!(clock.tick_at(at(160), at(1_010), false), at(1_003), "the timeout");
        assert_eq!(clock.tick_at(at(161), at(1_010), false), at(1_003));
        assert_eq!(clock.set_speed(TimeSpeed::Max), Err(FollowsClient));
        clock.advance(Duration::from_millis(5));
        assert_eq!(clock.tick_at(at(162), at(1_010), false), at(1_008));
    }
}

//! Decides which client drives the arm, and which clients may.
//!
//! A client drives while it writes targets: until it has written none for a second or hands over, or until the arm is stopped.
//! If several may write, the last one drives. A stop ends the streams of the other clients: their targets are dropped until they
//! start anew. They do so by a pause of a second without a target, by a command, or by a stop. Positions for IK, and writes that
//! switch the motors on, the effector or the pump, count as targets here.

use protocol_core::time::{Duration, Instant};

use super::client_id::ClientId;

/// A client that has written no target for this long does not drive any more, and starts anew with its next one.
pub(crate) const PAUSE: Duration = Duration::from_millis(1_000);

/// The history of a client as a source of motion.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Driving {
    /// When it wrote a target last, carried out or not.
    last_motion: Option<Instant>,
    /// A stop of another client ended its stream.
    is_stopped: bool,
}

impl Driving {
    fn is_active(self, now: Instant) -> bool {
        self.last_motion.is_some_and(|at| now - at < PAUSE)
    }

    /// Notes that another client stopped the arm. That ends the stream of this client, if it wrote a target in the last second.
    pub(crate) fn stop(&mut self, now: Instant) {
        self.is_stopped |= self.is_active(now);
    }

    /// The client says that it starts anew.
    pub(crate) const fn start_anew(&mut self) {
        self.is_stopped = false;
    }

    /// Are its targets dropped because of a stop?
    pub(crate) fn is_stopped(self, now: Instant) -> bool {
        self.is_stopped && self.is_active(now)
    }

    /// The client writes a target. Returns whether a stop forbids it.
    fn note_motion(&mut self, now: Instant) -> bool {
        self.is_stopped = self.is_stopped(now);
        self.last_motion = Some(now);
        self.is_stopped
    }
}

/// Why a target is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MayNotMove {
    Stopped,
    AnotherDrives,
}

/// The client that drives the arm.
#[derive(Debug, Default)]
pub(crate) struct Driver {
    /// The client that wrote a target last, and when. Targets that were dropped do not count.
    last: Option<(ClientId, Instant)>,
    /// Only one client drives at a time.
    is_exclusive: bool,
}

impl Driver {
    /// No client drives yet. `is_exclusive`: only one client drives at a time.
    pub(crate) const fn new(is_exclusive: bool) -> Self {
        Self { last: None, is_exclusive }
    }

    /// The client that drives.
    pub(crate) fn at(&self, now: Instant) -> Option<ClientId> {
        self.last.filter(|&(_, at)| now - at < PAUSE).map(|(id, _)| id)
    }

    /// Checks whether a client may write a target or switch something now. If so, the client drives.
    pub(crate) fn check(
        &mut self,
        now: Instant,
        id: ClientId,
        driving: &mut Driving,
    ) -> Result<(), MayNotMove> {
        if driving.note_motion(now) {
            return Err(MayNotMove::Stopped);
        }
        if self.is_exclusive && self.at(now).is_some_and(|driver| driver != id) {
            return Err(MayNotMove::AnotherDrives);
        }
        self.last = Some((id, now));
        Ok(())
    }

    /// The client `of` no longer drives: it hands over or is gone. `None`: no client drives, because the arm was stopped or lost.
    pub(crate) fn end(&mut self, of: Option<ClientId>) {
        self.last = self.last.filter(|&(id, _)| of.is_some_and(|of| of != id));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn a_stopped_client_starts_anew_after_a_pause() {
        let (id, mut driver, mut driving) = (ClientId::default(), Driver::default(), Driving::default());
        driving.stop(at_ms(0));
        assert_eq!(driver.check(at_ms(0), id, &mut driving), Ok(()), "it streamed nothing");
        driving.stop(at_ms(10));
        for millis in [20, 900, 1_800, 2_799] {
            assert_eq!(driver.check(at_ms(millis), id, &mut driving), Err(MayNotMove::Stopped));
        }
        assert_eq!(driver.check(at_ms(3_799), id, &mut driving), Ok(()), "a second later");
        driving.stop(at_ms(3_800));
        driving.start_anew();
        assert_eq!(driver.check(at_ms(3_801), id, &mut driving), Ok(()));
    }

    #[test]
    fn one_client_drives_until_it_is_silent_or_hands_over() {
        let (one, mut driver) = (ClientId::default(), Driver::new(true));
        let (mut first, mut second) = (Driving::default(), Driving::default());
        assert_eq!(driver.check(at_ms(0), one, &mut first), Ok(()));
        assert_eq!(driver.check(at_ms(999), one.next(), &mut second), Err(MayNotMove::AnotherDrives));
        assert_eq!(driver.check(at_ms(1_000), one.next(), &mut second), Ok(()));
        assert_eq!(driver.check(at_ms(1_001), one, &mut first), Err(MayNotMove::AnotherDrives));
        driver.end(Some(one));
        assert_eq!(driver.at(at_ms(1_001)), Some(one.next()), "it does not drive");
        driver.end(Some(one.next()));
        assert_eq!(driver.check(at_ms(1_002), one, &mut first), Ok(()));
    }
}

//! Turns the actions of a program, which come at any time, into the points of a stream. Arithmetic without an arm or a clock.
//!
//! ```text
//!   offer ──▶ the newest action ──▶ next: Send it when a point is due, and again each period, while the program is there
//!                                         AskWatchdog once the program was silent for long
//! ```
//!
//! All times count from the same instant, as [`Arm::elapsed`](crate::Arm::elapsed) does.

use std::time::Duration;

use super::pace::StreamPace;
use super::{StreamOptions, WATCHDOG_MARGIN};
use crate::fine_state::FineTargets;

/// What the sender of [`LatestPoints`] does now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LatestStep {
    /// Send this point: [`SetPointStream::send`](super::SetPointStream::send).
    Send(FineTargets),
    /// Read whether the watchdog of the arm has acted, and if so call [`LatestPoints::watchdog_acted`].
    AskWatchdog,
}

/// How the actions of a program became points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LatestCounts {
    /// Points that were sent, repeated ones included.
    pub sent: u32,
    /// Actions that a newer one replaced before a point was due.
    pub skipped: u32,
    /// Points without a new action: the last one again.
    pub repeated: u32,
    /// Points that were due and not sent, because the sender was late.
    pub missed: u32,
    /// How many times the program was silent for so long that the watchdog of the arm acted.
    pub watchdog: u32,
}

/// The points of a program that offers actions at any time.
///
/// A point is due each period. It is the newest action; without a new one the last point is sent again, so that a damaged frame
/// costs no action. Once the program has offered nothing for the time of the watchdog, nothing more is sent but an action that
/// waits for its point. The watchdog of the arm acts when its time has passed since the last frame (D24). If that time is longer
/// than two periods and a control cycle, joints that keep up stand at the last point by then (D23).
///
/// ```
/// use sevenbot::FineAngle;
/// use sevenbot::stream::{LatestPoints, LatestStep, StreamOptions};
/// use std::time::Duration;
///
/// let options = StreamOptions::new(20).ok_or("a period")?;
/// let mut points = LatestPoints::new(options);
/// let start = Duration::from_secs(1);
/// points.offer(start, &[FineAngle::from_hundredths(9_000); 7]);
/// assert!(matches!(points.next(start), Some(LatestStep::Send(_))));
/// assert_eq!(points.next(start), None, "the next point is due after a period");
/// assert!(matches!(points.next(start + options.period()), Some(LatestStep::Send(_))));
/// assert_eq!(points.counts().repeated, 1);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Debug)]
pub struct LatestPoints {
    options: StreamOptions,
    /// `None` before the first action, and after [`Self::stop`].
    leading: Option<Leading>,
    counts: LatestCounts,
}

/// A program that offers actions.
#[derive(Clone, Debug)]
struct Leading {
    pace: StreamPace,
    /// The newest angle of each joint.
    newest: FineTargets,
    /// Does the newest action wait for its point?
    is_new: bool,
    offered: Duration,
    /// Was [`LatestStep::AskWatchdog`] returned in this silence of the program?
    was_asked: bool,
}

impl LatestPoints {
    /// Without an action: [`Self::next`] returns `None` until the first [`Self::offer`].
    #[must_use]
    pub fn new(options: StreamOptions) -> Self {
        Self { options, leading: None, counts: LatestCounts::default() }
    }

    /// Takes an action. A joint without an angle keeps the angle of earlier actions. The first point is due at once, and so is
    /// the first one after a silence.
    pub fn offer(&mut self, now: Duration, action: &FineTargets) {
        let is_silent = self.is_silent(now);
        let Some(leading) = &mut self.leading else {
            let pace = StreamPace::new(now, self.options.period());
            let (newest, offered) = (*action, now);
            self.leading = Some(Leading { pace, newest, is_new: true, offered, was_asked: false });
            return;
        };
        self.counts.skipped += u32::from(leading.is_new);
        for (angle, newer) in leading.newest.iter_mut().zip(action) {
            *angle = newer.or(*angle);
        }
        (leading.is_new, leading.offered, leading.was_asked) = (true, now, false);
        if is_silent {
            leading.pace.restart(now);
        }
    }

    /// What to do at `now`. Call it until it returns `None`, and again at [`Self::wake_at`].
    pub fn next(&mut self, now: Duration) -> Option<LatestStep> {
        let (is_silent, watchdog) = (self.is_silent(now), self.options.watchdog_time());
        let leading = self.leading.as_mut()?;
        if is_silent && !leading.is_new {
            // No point is sent until the next action, so none stays due.
            leading.pace.restart(now);
            let is_due = now >= leading.asks_at(watchdog) && !leading.was_asked;
            leading.was_asked |= is_due;
            return is_due.then_some(LatestStep::AskWatchdog);
        }
        let due = leading.pace.due();
        if now < due {
            return None;
        }
        let first = leading.pace.number_at(due);
        self.counts.missed += leading.pace.take(now).saturating_sub(first);
        self.counts.repeated += u32::from(!leading.is_new);
        self.counts.sent += 1;
        leading.is_new = false;
        Some(LatestStep::Send(leading.newest))
    }

    /// When [`Self::next`] has something to do; `None`: not before the next action.
    #[must_use]
    pub fn wake_at(&self) -> Option<Duration> {
        let (leading, watchdog) = (self.leading.as_ref()?, self.options.watchdog_time());
        let due = leading.pace.due();
        if leading.is_new || !leading.is_silent(due, watchdog) {
            return Some(due);
        }
        (!leading.was_asked).then(|| leading.asks_at(watchdog))
    }

    /// Has the program offered nothing for the time of the watchdog? Then the sender sends nothing. Also true before the first
    /// action. `false` while an action waits for its point.
    #[must_use]
    pub fn is_silent(&self, now: Duration) -> bool {
        let watchdog = self.options.watchdog_time();
        self.leading.as_ref().is_none_or(|leading| !leading.is_new && leading.is_silent(now, watchdog))
    }

    /// Has the program offered an action since the start, or since [`Self::stop`]?
    #[must_use]
    pub const fn is_leading(&self) -> bool {
        self.leading.is_some()
    }

    /// Does an action wait for its point?
    #[must_use]
    pub fn has_new(&self) -> bool {
        self.leading.as_ref().is_some_and(|leading| leading.is_new)
    }

    /// Makes the next point due at `now`, for a sender that was busy with another task.
    pub fn restart(&mut self, now: Duration) {
        self.leading.iter_mut().for_each(|leading| leading.pace.restart(now));
    }

    /// Counts that the watchdog of the arm has acted.
    pub const fn watchdog_acted(&mut self) {
        self.counts.watchdog += 1;
    }

    /// Forgets the action: nothing is sent until the next one.
    pub fn stop(&mut self) {
        self.leading = None;
    }

    /// The counts of points and actions so far.
    #[must_use]
    pub const fn counts(&self) -> LatestCounts {
        self.counts
    }
}

impl Leading {
    fn is_silent(&self, now: Duration, watchdog: Option<Duration>) -> bool {
        watchdog.is_some_and(|time| now >= self.offered + time)
    }

    /// When to ask. By then the watchdog has acted, because the last frame was sent before the program counted as silent. Only an
    /// action that waits for its point for longer than the watchdog's time is sent later.
    fn asks_at(&self, watchdog: Option<Duration>) -> Duration {
        self.offered + 2 * watchdog.unwrap_or_default() + WATCHDOG_MARGIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine_angle::FineAngle;

    const START: Duration = Duration::from_secs(5);

    fn points() -> LatestPoints {
        LatestPoints::new(StreamOptions::new(20).expect("a period"))
    }

    fn action(degrees: u16) -> FineTargets {
        [FineAngle::from_hundredths(degrees * 100); 7]
    }

    fn after(millis: u64) -> Duration {
        START + Duration::from_millis(millis)
    }

    /// The steps of a sender that wakes up at [`LatestPoints::wake_at`].
    fn sent_until(points: &mut LatestPoints, end: Duration) -> Vec<(Duration, LatestStep)> {
        let mut sent = Vec::new();
        while let Some(now) = points.wake_at().filter(|now| *now < end) {
            sent.extend(points.next(now).map(|step| (now, step)));
        }
        sent
    }

    #[test]
    fn the_newest_action_goes_out_each_period_and_the_others_are_skipped() {
        let mut points = points();
        points.offer(START, &action(90));
        assert_eq!(points.next(START), Some(LatestStep::Send(action(90))));
        for (millis, degrees) in [(5, 91), (10, 92), (19, 93)] {
            points.offer(after(millis), &action(degrees));
            assert_eq!(points.next(after(millis)), None);
        }
        assert_eq!(
            (points.wake_at(), points.next(after(20))),
            (Some(after(20)), Some(LatestStep::Send(action(93))))
        );
        let counts = LatestCounts { sent: 2, skipped: 2, ..LatestCounts::default() };
        assert_eq!(points.counts(), counts);
    }

    #[test]
    fn a_slow_program_keeps_the_grid_by_repeated_points() {
        let mut points = points();
        for number in 0..10 {
            points.offer(after(number * 75), &action(90));
            for (now, step) in sent_until(&mut points, after((number + 1) * 75)) {
                assert_eq!(step, LatestStep::Send(action(90)));
                assert_eq!((now - START).as_millis() % 20, 0);
            }
        }
        assert_eq!((points.counts().sent, points.counts().repeated), (38, 28));
    }

    #[test]
    fn d24_a_silent_program_is_left_to_the_watchdog() {
        let mut points = points();
        points.offer(START, &action(90));
        let sent = sent_until(&mut points, after(10_000));
        assert_eq!(sent.len(), 16, "until 300 ms, and one question");
        assert_eq!(sent[14], (after(280), LatestStep::Send(action(90))));
        assert_eq!(sent[15], (after(650), LatestStep::AskWatchdog));
        assert!(points.is_silent(after(300)) && points.wake_at().is_none());
        points.offer(after(10_005), &action(91));
        assert_eq!(points.next(after(10_005)), Some(LatestStep::Send(action(91))), "on a grid of its own");
        assert_eq!(points.counts().missed, 0);
        assert_eq!(points.wake_at(), Some(after(10_025)));
    }

    #[test]
    fn a_sender_that_misses_the_last_point_before_a_silence_waits() {
        let mut points = points();
        points.offer(START, &action(90));
        assert!(points.next(START).is_some());
        assert_eq!((points.next(after(310)), points.wake_at()), (None, Some(after(650))));
        assert_eq!(points.next(after(650)), Some(LatestStep::AskWatchdog));
        assert_eq!(points.wake_at(), None);
    }

    #[test]
    fn a_late_sender_misses_points() {
        let mut points = points();
        points.offer(START, &action(90));
        assert!(points.next(START).is_some());
        points.offer(after(30), &action(91));
        assert_eq!(points.next(after(85)), Some(LatestStep::Send(action(91))));
        assert_eq!((points.counts().missed, points.wake_at()), (3, Some(after(100))));
    }

    #[test]
    fn a_joint_without_an_angle_keeps_that_of_the_action_before() {
        let mut points = points();
        points.offer(START, &action(90));
        let mut only_first = [None; 7];
        only_first[0] = action(95)[0];
        points.offer(START, &only_first);
        let mut wanted = action(90);
        wanted[0] = only_first[0];
        assert_eq!(points.next(START), Some(LatestStep::Send(wanted)));
    }

    #[test]
    fn without_a_watchdog_the_last_point_is_repeated_for_ever() {
        let options =
            StreamOptions::new(20).expect("a period").with_watchdog(0, super::super::WatchdogAction::Hold);
        let mut points = LatestPoints::new(options);
        points.offer(START, &action(90));
        assert_eq!(sent_until(&mut points, after(100_000)).len(), 5_000);
        points.stop();
        assert!(points.wake_at().is_none() && points.next(after(100_000)).is_none());
    }
}

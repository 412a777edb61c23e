//! Finds out that a servo holds no torque although it should, and when its joint may engage anew
//! ([D28](protocol_core::decisions#d28)).
//!
//! ```text
//!            torque switch off, or an alarm without load while the joint leaves its set-point
//!   Holding ──────────────────────────────────────────────────────────────────────────────▶ LetGo
//!      ▲                                                                                      │
//!      └── engaged anew: no alarm for 500 ms, at rest after an overload, cooler after heat ───┘
//! ```
//!
//! A joint engages anew at most three times in a minute. After that it needs an order of the host. This file does not
//! know registers or the bus.

use protocol_core::time::{Duration, Instant};

use crate::calibration::MicroDegrees;
use crate::servo_bus::Answer;
use crate::servo_bus::frame::error::{OVERHEAT, OVERLOAD};

/// With an alarm and no load, a joint counts as freed if it is farther than this from its set-point, in millionths of a
/// degree, for [`FAR_FOR`].
const FAR: u32 = 3_000_000;
/// See [`FAR`].
const FAR_FOR: Duration = Duration::from_millis(200);
/// With an alarm and no load, a joint also counts as freed if it has turned away by this much, in millionths of a degree, from
/// the angle that was nearest to its set-point since the alarm.
const TURNED_AWAY: i32 = 1_000_000;
/// A joint engages anew when its alarm has been gone for this long or, after an overload, when it has been at rest for
/// this long.
const CALM_FOR: Duration = Duration::from_millis(500);
/// A joint that turns no faster is at rest, in counts per second: 12.7 degrees/s for joints 1 to 4, 17 for the others.
/// A damped arm with 300 g sinks at 7 degrees/s, so it can engage while it sinks.
const REST_SPEED: u16 = 60;
/// How much cooler a servo has to be than when it became too hot, in degrees Celsius.
const COOLER_BY: u8 = 5;
/// A joint engages anew at most [`ATTEMPTS`] times in this time.
const WINDOW: Duration = Duration::from_millis(60_000);
/// See [`WINDOW`].
const ATTEMPTS: usize = 3;

/// Whether the servo of one joint holds it, and how often the joint engaged anew.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct LetGo {
    state: State,
    /// When the joint engaged anew, the latest first.
    attempts: [Option<Instant>; ATTEMPTS],
    /// The joint engaged too often. Only the host can make it engage again.
    is_exhausted: bool,
    /// The host has ordered the joint to engage.
    is_ordered: bool,
}

#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum State {
    Holding,
    /// There is an alarm and no load. `nearest` is the angle nearest to the set-point since then. `far_since` is when
    /// the joint came farther than [`FAR`] from it; `None` while it is nearer.
    Suspected {
        nearest: MicroDegrees,
        far_since: Option<Instant>,
    },
    LetGo {
        /// All alarms since the joint was let go.
        alarms: u8,
        /// The temperature when the servo became too hot, in degrees Celsius.
        hot_at: u8,
        /// When the last answer with an alarm that ends by itself came: any but an overload.
        alarm_at: Instant,
        /// When the last answer came in which the joint was not at rest.
        moved_at: Instant,
        /// According to its last answer, an alarm keeps the servo from holding. A servo that was too hot holds again by
        /// itself when the alarm ends.
        is_freed: bool,
        /// Torque-off was sent: without it a latched overload would not end.
        has_torque_off: bool,
    },
}

impl LetGo {
    /// A joint that is held.
    pub(crate) const NO: Self =
        Self { state: State::Holding, attempts: [None; ATTEMPTS], is_exhausted: false, is_ordered: false };

    pub(crate) const fn is_let_go(&self) -> bool {
        matches!(self.state, State::LetGo { .. })
    }

    /// Does an alarm keep the servo from holding the joint? Then it gets torque-off, which frees nothing and ends a latched
    /// overload. Without protection only the host can order that.
    pub(crate) const fn needs_torque_off(&self, is_protected: bool) -> bool {
        matches!(self.state, State::LetGo { is_freed: true, .. }) && (is_protected || self.is_ordered)
    }

    /// Records that torque-off is sent, because of [`LetGo::needs_torque_off`].
    pub(crate) const fn torque_off_is_sent(&mut self) {
        if let State::LetGo { has_torque_off, .. } = &mut self.state {
            *has_torque_off = true;
        }
    }

    /// Takes an answer of the servo of a joint with a set-point. Returns whether an alarm has freed the joint.
    pub(crate) fn is_freed(
        &mut self,
        now: Instant,
        answer: &Answer,
        angle: MicroDegrees,
        set_point: MicroDegrees,
    ) -> bool {
        if answer.alarms == 0 || answer.reading.load != 0 {
            if let State::Suspected { .. } = self.state {
                self.state = State::Holding;
            }
            return false;
        }
        let is_far = angle.0.abs_diff(set_point.0) > FAR;
        match &mut self.state {
            State::Holding => {
                self.state = State::Suspected { nearest: angle, far_since: is_far.then_some(now) };
                false
            }
            State::Suspected { nearest, far_since } => {
                // Only a turn of the joint counts, not a step of the set-point: the servo of a joint at rest may have
                // no load yet.
                let turned = angle.0 - nearest.0;
                let turned_away = if angle.0 < set_point.0 { -turned } else { turned };
                if turned_away < 0 {
                    *nearest = angle;
                }
                let since = *far_since.get_or_insert(now);
                if !is_far {
                    *far_since = None;
                }
                turned_away >= TURNED_AWAY || (is_far && now - since >= FAR_FOR)
            }
            State::LetGo { .. } => false,
        }
    }

    /// Records that the joint is let go from now on.
    pub(crate) fn let_go(&mut self, now: Instant) {
        self.state = State::LetGo {
            alarms: 0,
            hot_at: 0,
            alarm_at: now,
            moved_at: now,
            is_freed: false,
            has_torque_off: false,
        };
        self.is_ordered = false;
    }

    /// Takes an answer of the servo of a joint that is let go.
    pub(crate) fn follow(&mut self, now: Instant, answer: &Answer) {
        let State::LetGo { alarms, hot_at, alarm_at, moved_at, is_freed, .. } = &mut self.state else {
            return;
        };
        *is_freed = answer.alarms != 0 && answer.reading.load == 0;
        if answer.alarms & !*alarms & OVERHEAT != 0 {
            *hot_at = answer.reading.temperature_celsius;
        }
        *alarms |= answer.alarms;
        if answer.alarms & !OVERLOAD != 0 {
            *alarm_at = now;
        }
        if answer.reading.speed.unsigned_abs() > REST_SPEED {
            *moved_at = now;
        }
    }

    /// May the joint engage now, at this temperature of its servo in degrees Celsius? Without `is_protected` it needs
    /// an order of the host.
    pub(crate) fn may_engage(&mut self, now: Instant, temperature: u8, is_protected: bool) -> bool {
        let State::LetGo { alarms, hot_at, alarm_at, moved_at, is_freed, has_torque_off } = self.state else {
            return true;
        };
        let is_calm = (!is_freed || has_torque_off)
            && (alarms & !OVERLOAD == 0 || now - alarm_at >= CALM_FOR)
            && (alarms & OVERLOAD == 0 || now - moved_at >= CALM_FOR)
            && (alarms & OVERHEAT == 0 || temperature.saturating_add(COOLER_BY) <= hot_at);
        if is_calm && self.attempts.iter().all(|attempt| attempt.is_some_and(|at| now - at < WINDOW)) {
            self.is_exhausted = true;
        }
        is_calm && !self.is_exhausted && (is_protected || self.is_ordered)
    }

    /// Records that the joint engaged at `now`. If it was let go, this counts as an attempt.
    pub(crate) fn engaged(&mut self, now: Instant) {
        if self.is_let_go() {
            let [first, second, _] = self.attempts;
            self.attempts = [Some(now), first, second];
        }
        self.state = State::Holding;
    }

    /// Records that the host wrote the motor state: the joint may engage again, and the attempts count anew.
    pub(crate) const fn ordered(&mut self) {
        self.attempts = [None; ATTEMPTS];
        self.is_exhausted = false;
        self.is_ordered = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo_bus::Reading;
    use crate::servo_bus::frame::error::VOLTAGE;

    const SET_POINT: i32 = 90_000_000;

    /// An answer without load and with an alarm of the supply voltage.
    fn answer() -> Answer {
        let reading = Reading {
            position_counts: 511,
            speed: 0,
            load: 0,
            voltage_decivolts: 60,
            temperature_celsius: 30,
        };
        Answer { reading, alarms: VOLTAGE, torque: None, answer_micros: 0 }
    }

    /// Returns whether the joint is freed at the last of these answers. Each has a time in milliseconds, and an angle and a
    /// set-point in millionths of a degree.
    fn is_freed(answers: &[(u64, i32, i32)]) -> bool {
        let mut let_go = LetGo::NO;
        answers.iter().fold(false, |_, &(millis, angle, set_point)| {
            let now = Instant::from_micros(millis * 1_000);
            let_go.is_freed(now, &answer(), MicroDegrees(angle), MicroDegrees(set_point))
        })
    }

    #[test]
    fn d28_a_joint_whose_set_point_leaves_it_is_not_let_go() {
        let starts = [(0, SET_POINT, SET_POINT), (10, SET_POINT, SET_POINT + 3_720_000)];
        assert!(!is_freed(&starts), "its servo has not begun to push yet");
        let turns_after_it = [starts[0], starts[1], (20, SET_POINT + 2_000_000, SET_POINT + 7_440_000)];
        assert!(!is_freed(&turns_after_it));
        let stands: Vec<_> = (0..25).map(|step| (10 * step, SET_POINT, SET_POINT + 3_720_000)).collect();
        assert!(is_freed(&stands), "too far away for 200 ms");
    }

    #[test]
    fn d28_a_joint_that_turns_away_from_its_set_point_is_let_go() {
        for way in [-1, 1] {
            let falls = |degrees| (100, SET_POINT + way * degrees, SET_POINT);
            assert!(!is_freed(&[falls(0), falls(900_000)]));
            assert!(is_freed(&[falls(0), falls(1_000_000)]));
            assert!(is_freed(&[falls(2_000_000), falls(500_000), falls(1_500_000)]), "back, and away again");
        }
    }
}

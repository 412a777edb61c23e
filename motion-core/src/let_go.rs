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
//! A joint engages anew three times in a minute, and then only after an order of the host. This file does not know
//! registers or the bus.

use protocol_core::time::{Duration, Instant};

use crate::calibration::MicroDegrees;
use crate::servo_bus::Answer;
use crate::servo_bus::frame::error::{OVERHEAT, OVERLOAD};

/// A joint that an alarm freed is this far from its set-point at least.
const FAR: u32 = 3_000_000;
/// For this long.
const FAR_FOR: Duration = Duration::from_millis(200);
/// Or it has moved away from its set-point by this much since the alarm came without load.
const MOVED_AWAY: u32 = 1_000_000;
/// How long an alarm has to be gone, and a joint to be at rest after an overload.
const CALM_FOR: Duration = Duration::from_millis(500);
/// A joint that turns slower is at rest, in counts per second: a damped joint sinks as slowly.
const REST_SPEED: u16 = 60;
/// How much cooler a servo has to be than when it became too hot, in degrees Celsius.
const COOLER_BY: u8 = 5;
/// A joint engages anew at most [`ATTEMPTS`] times in this time.
const WINDOW: Duration = Duration::from_millis(60_000);
/// See [`WINDOW`].
const ATTEMPTS: usize = 3;

/// Does the servo of one joint hold it?
#[derive(Clone, Debug)]
pub(crate) struct LetGo {
    state: State,
    /// When the joint engaged anew, the latest first.
    attempts: [Option<Instant>; ATTEMPTS],
    /// It engaged too often. Only the host can make it engage again.
    is_exhausted: bool,
    /// The host has ordered it to engage.
    is_ordered: bool,
}

#[derive(Clone, Debug)]
enum State {
    Holding,
    /// There is an alarm and no load. The joint was `distance` from its set-point when this began, and is far from it since.
    Suspected {
        distance: u32,
        far_since: Option<Instant>,
    },
    LetGo {
        /// All alarms since it was let go.
        alarms: u8,
        /// The temperature when the servo became too hot, in degrees Celsius.
        hot_at: u8,
        /// The last answer with an alarm that ends by itself.
        alarm_at: Instant,
        /// The last answer at which the joint was not at rest.
        moved_at: Instant,
        /// According to its last answer, an alarm keeps the servo from holding. When heat ends, a servo holds by itself.
        is_freed: bool,
        /// Torque-off was sent: without it a latched overload would not end.
        has_torque_off: bool,
    },
}

impl LetGo {
    /// A joint that is held.
    pub(crate) const NO: Self =
        Self { state: State::Holding, attempts: [None; ATTEMPTS], is_exhausted: false, is_ordered: false };

    /// Is the joint let go?
    pub(crate) const fn is_let_go(&self) -> bool {
        matches!(self.state, State::LetGo { .. })
    }

    /// Does an alarm keep the servo from holding the joint? Then it gets torque-off, which frees nothing and ends a latched
    /// overload. Without protection only the host can order that.
    pub(crate) const fn needs_torque_off(&self, is_protected: bool) -> bool {
        matches!(self.state, State::LetGo { is_freed: true, .. }) && (is_protected || self.is_ordered)
    }

    /// Torque-off is sent because of [`LetGo::needs_torque_off`].
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
        let distance = angle.0.abs_diff(set_point.0);
        let is_far = distance > FAR;
        match &mut self.state {
            State::Holding => {
                self.state = State::Suspected { distance, far_since: is_far.then_some(now) };
                false
            }
            State::Suspected { distance: first, far_since } => {
                *first = distance.min(*first);
                let since = *far_since.get_or_insert(now);
                if !is_far {
                    *far_since = None;
                }
                distance - *first >= MOVED_AWAY || (is_far && now - since >= FAR_FOR)
            }
            State::LetGo { .. } => false,
        }
    }

    /// The joint is let go from now on.
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

    /// May the joint engage now, at this temperature of its servo in degrees Celsius? By itself only if `is_protected`.
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

    /// The joint engaged at `now`.
    pub(crate) fn engaged(&mut self, now: Instant) {
        if self.is_let_go() {
            let [first, second, _] = self.attempts;
            self.attempts = [Some(now), first, second];
        }
        self.state = State::Holding;
    }

    /// The host wrote the motor state: the joint may engage again, and the attempts count anew.
    pub(crate) const fn ordered(&mut self) {
        self.attempts = [None; ATTEMPTS];
        self.is_exhausted = false;
        self.is_ordered = true;
    }
}

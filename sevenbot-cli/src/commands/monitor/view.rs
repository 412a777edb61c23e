//! The content of the monitor's screen as data, without terminal, arm and clock.
//!
//! ```text
//!   events from the arm ──▶ ┌──────┐
//!                         │ View │ ──▶ draw: for a terminal or a test
//!   keys ─── keys.rs ───▶ └──────┘
//!               └──▶ commands to the arm
//! ```

use std::collections::VecDeque;
use std::time::Duration;

use sevenbot::cartesian::JogAxes;
use sevenbot::{Joint, StatusBlock};

use super::plot_kind::{PastSample, PlotKind};
use super::sample::ArmSample;

pub(crate) const PLOT_SPAN: Duration = Duration::from_secs(20);
/// A note disappears after this time.
const NOTE_DURATION: Duration = Duration::from_secs(6);
/// Weight of a new round trip in the running mean.
const MEAN_WEIGHT: f64 = 0.1;

/// An event from the arm's thread.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "nearly every event is a sample")]
pub(crate) enum ArmEvent {
    /// Connected: port and firmware version.
    Found {
        port: String,
        firmware: String,
    },
    /// Not connected, for this reason.
    Lost(String),
    Sample(ArmSample),
    /// A question without an answer, and the number of damaged frames received.
    Unanswered {
        damaged: usize,
    },
    /// A command failed, for this reason.
    Refused(String),
    /// A command was executed, and the user should know this.
    Warned(String),
}

/// A command from the user to the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UiCommand {
    /// Change a joint's target by some degrees.
    Nudge { joint: Joint, degrees: i16 },
    /// Move the tip by x, y and z along these axes.
    Jog { axes: JogAxes, millimetres: [i16; 3] },
    /// Apply the change to the speed of this joint, and set the speed of all joints to the result.
    SpeedChange { joint: Joint, change: SpeedChange },
    /// Change to this motor state (register 29). State servo makes an arm that is driven already hold.
    State(u8),
    /// Make the arm hold where it is.
    Stop,
}

/// Direction of a change of speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpeedChange {
    Faster,
    Slower,
}

impl SpeedChange {
    /// Size of a change, in steps of the register.
    const CHANGE: u8 = 5;
    /// The highest value of the register. The value 0 is faster: the motor's maximum (D10).
    const HIGHEST: u8 = 100;

    /// The value of the speed register after the change.
    pub(crate) const fn after(self, steps: u8) -> u8 {
        match (self, steps) {
            (Self::Faster, 0 | Self::HIGHEST) => 0,
            (Self::Faster, _) if steps > Self::HIGHEST - Self::CHANGE => Self::HIGHEST,
            (Self::Faster, _) => steps + Self::CHANGE,
            (Self::Slower, 0) => Self::HIGHEST,
            (Self::Slower, _) if steps <= Self::CHANGE => 1,
            (Self::Slower, _) => steps - Self::CHANGE,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum LinkState {
    /// Not connected, for this reason.
    Looking(String),
    /// Connected to an arm with this firmware version.
    Open { firmware: String },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dialog {
    Help,
    /// The choice of a motor state.
    ChooseState,
    /// The confirmation of a motor state without torque.
    ConfirmState(u8),
}

/// Statistics of the host link.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LinkQuality {
    pub(crate) answers: u64,
    pub(crate) unanswered: u64,
    /// Damaged frames received instead of an answer.
    pub(crate) damaged: usize,
    /// The arm's counter of damaged frames: at the first sample of this connection, and now.
    corrupted: Option<(u16, u16)>,
    /// Mean round-trip time of about the last ten samples, in milliseconds.
    pub(crate) round_trip_ms: f64,
}

impl LinkQuality {
    fn answer(&mut self, sample: &ArmSample) {
        let last = sample.round_trip.as_secs_f64() * 1e3;
        let mean = if self.answers == 0 { last } else { self.round_trip_ms };
        self.round_trip_ms = mean + (last - mean) * MEAN_WEIGHT;
        self.answers += 1;
        if let Some(now) = sample.joints.status().map(StatusBlock::frames_corrupted) {
            self.corrupted = Some((self.corrupted.map_or(now, |(first, _)| first), now));
        }
    }

    /// Damaged frames that the arm has counted since it was connected; 0 if it does not count them.
    pub(crate) fn damaged_at_arm(&self) -> u16 {
        self.corrupted.map_or(0, |(first, now)| now.wrapping_sub(first))
    }
}

/// The content of the screen.
#[derive(Clone, Debug)]
pub(crate) struct MonitorView {
    pub(crate) port: String,
    pub(crate) connection: LinkState,
    /// The last sample, or the frozen one.
    pub(crate) sample: Option<ArmSample>,
    /// In the last sample, also while the screen is frozen.
    motor_state: Option<u8>,
    /// The samples of the last [`PLOT_SPAN`], oldest first.
    pub(crate) past: VecDeque<PastSample>,
    pub(crate) plot: PlotKind,
    /// The time at the right end of the plot.
    pub(crate) now: Duration,
    pub(crate) link: LinkQuality,
    pub(crate) selected: Joint,
    /// The axes along which the arrow keys move the tip; `None`: they select and nudge joints.
    pub(crate) jog: Option<JogAxes>,
    pub(crate) is_frozen: bool,
    pub(crate) dialog: Option<Dialog>,
    note: Option<(Duration, String)>,
    clock: Duration,
}

impl MonitorView {
    pub(crate) fn new(port: &str, plot: PlotKind) -> Self {
        Self {
            port: port.to_owned(),
            connection: LinkState::Looking("opening the port".to_owned()),
            sample: None,
            motor_state: None,
            past: VecDeque::new(),
            plot,
            now: Duration::ZERO,
            link: LinkQuality::default(),
            selected: Joint::ALL[0],
            jog: None,
            is_frozen: false,
            dialog: None,
            note: None,
            clock: Duration::ZERO,
        }
    }

    /// Sets the time since the start of the monitor.
    pub(crate) fn tick(&mut self, clock: Duration) {
        self.clock = clock;
        if !self.is_frozen {
            self.now = clock;
        }
    }

    pub(crate) fn update(&mut self, event: ArmEvent) {
        match event {
            ArmEvent::Found { port, firmware } => {
                self.port = port;
                self.connection = LinkState::Open { firmware };
                // The arm may have restarted, with new counters.
                self.link.corrupted = None;
            }
            ArmEvent::Lost(reason) => self.connection = LinkState::Looking(reason),
            ArmEvent::Sample(sample) => self.add_sample(sample),
            ArmEvent::Unanswered { damaged } => {
                self.link.unanswered += 1;
                self.link.damaged += damaged;
            }
            ArmEvent::Refused(text) | ArmEvent::Warned(text) => self.show_note(text),
        }
    }

    fn add_sample(&mut self, sample: ArmSample) {
        self.link.answer(&sample);
        self.motor_state = Some(sample.joints.motor_state());
        if self.is_frozen {
            return;
        }
        self.past.push_back(PastSample::from(&sample));
        while self.past.front().is_some_and(|past| past.time + PLOT_SPAN < sample.time) {
            self.past.pop_front();
        }
        self.sample = Some(sample);
    }

    /// Shows a note for some seconds.
    pub(crate) fn show_note(&mut self, note: impl Into<String>) {
        self.note = Some((self.clock, note.into()));
    }

    /// The note, if it is not old.
    pub(crate) fn note(&self) -> Option<&str> {
        let (since, note) = self.note.as_ref()?;
        (self.clock < *since + NOTE_DURATION).then_some(note)
    }

    /// The last sample, or the frozen one, while the arm is connected.
    pub(crate) fn arm(&self) -> Option<&ArmSample> {
        self.sample.as_ref().filter(|_| matches!(self.connection, LinkState::Open { .. }))
    }

    /// The motor state in the last sample, while the arm is connected.
    pub(crate) fn motor_state(&self) -> Option<u8> {
        self.arm().and(self.motor_state)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use sevenbot::arm::STATUS;
    use sevenbot::joints::JointSnapshot;
    use sevenbot::map::{MOTOR_STATE, PRESENT_POSITION, SPEED, TARGET_POSITION};
    use sevenbot::{Snapshot, Span};

    fn set(registers: &mut Snapshot, address: u8, values: &[u8]) {
        let first = usize::from(address - registers.address);
        registers.values[first..first + values.len()].copy_from_slice(values);
    }

    fn zeros(span: Span) -> Snapshot {
        Snapshot { address: span.address(), values: vec![0; span.count().into()] }
    }

    /// A sample in which joint 2 stands at `position` on its way to 120 degrees.
    pub(crate) fn sample(millis: u64, position: u8) -> ArmSample {
        sample_in(1, millis, position)
    }

    /// As [`sample`], in a motor state.
    pub(crate) fn sample_in(motor_state: u8, millis: u64, position: u8) -> ArmSample {
        let mut registers = zeros(JointSnapshot::REGISTERS);
        set(&mut registers, MOTOR_STATE.address, &[motor_state]);
        set(&mut registers, SPEED.address, &[10; 7]);
        set(&mut registers, TARGET_POSITION.address, &[90, 120, 65, 90, 90, 90, 80]);
        set(&mut registers, PRESENT_POSITION.address, &[90, position, 65, 90, 90, 90, 80]);
        let mut status = zeros(STATUS);
        set(&mut status, STATUS.address(), &[1, 0, 0, u8::from(position != 120) << 1]);
        set(&mut status, 254, &[74, 31]);
        let mut all = Snapshot { address: 0, values: vec![0; 256] };
        for part in [&registers, &status] {
            set(&mut all, part.address, &part.values);
        }
        ArmSample {
            time: Duration::from_millis(millis),
            health: sevenbot::Health::new(&all),
            joints: JointSnapshot::new(registers, Some(StatusBlock::from(status))),
            fine: None,
            round_trip: Duration::from_micros(4200),
        }
    }

    /// A view after 100 samples in 10 s, in which joint 2 moves from 90 to 109 degrees.
    pub(crate) fn watching() -> MonitorView {
        let mut view = MonitorView::new("/dev/ttyUSB0", PlotKind::Position);
        view.update(ArmEvent::Found { port: "/dev/ttyUSB0".to_owned(), firmware: "3.0".to_owned() });
        for tenth in 0..100_u8 {
            view.tick(Duration::from_millis(u64::from(tenth) * 100));
            view.update(ArmEvent::Sample(sample(u64::from(tenth) * 100, 90 + tenth / 5)));
        }
        view
    }

    #[test]
    fn the_plot_spans_twenty_seconds() {
        let mut view = watching();
        view.update(ArmEvent::Sample(sample(25_000, 120)));
        assert_eq!(view.past.front().map(|past| past.time), Some(Duration::from_secs(5)));
    }

    #[test]
    fn a_frozen_view_counts_answers_only() {
        let mut view = watching();
        view.is_frozen = true;
        view.tick(Duration::from_secs(60));
        view.update(ArmEvent::Sample(sample(60_000, 120)));
        assert_eq!((view.link.answers, view.motor_state()), (101, Some(1)));
        assert_eq!((view.now, view.past.len()), (Duration::from_millis(9900), 100));
    }

    #[test]
    fn a_lost_arm_takes_no_commands() {
        let mut view = watching();
        assert!(view.arm().is_some());
        view.update(ArmEvent::Lost("gone".to_owned()));
        assert!(view.arm().is_none());
        assert!(view.sample.is_some(), "what was last known is still shown");
    }

    #[test]
    fn speeds_end_at_the_maximum_and_at_the_slowest() {
        let from = |change: SpeedChange, first| {
            let speeds = std::iter::successors(Some(first), move |&steps| Some(change.after(steps)));
            speeds.take(5).collect::<Vec<u8>>()
        };
        assert_eq!(from(SpeedChange::Faster, 93), [93, 98, 100, 0, 0]);
        assert_eq!(from(SpeedChange::Slower, 8), [8, 3, 1, 1, 1]);
        assert_eq!(from(SpeedChange::Slower, 0), [0, 100, 95, 90, 85]);
    }

    #[test]
    fn a_note_disappears_after_six_seconds() {
        let mut view = watching();
        view.show_note("no");
        assert_eq!(view.note(), Some("no"));
        view.tick(Duration::from_secs(30));
        assert_eq!(view.note(), None);
    }
}

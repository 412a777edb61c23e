//! One arm that steps: targets as a frame, a time, and the reply to a read.

use arm_sim::Simulation;
use arm_sim::request::{Reply, Request};
use host_link::{Snapshot, Span};
use protocol_core::registers::map::{BLOCKED_JOINTS, FINE_POSITION, FINE_TARGET, SET_POINT_PERIOD};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::frame::{ParseOutcome, ToHost, parse};

use crate::fine_angle::FineAngle;
use crate::fine_state::FineState;

/// What each step reads: positions, velocities, loads and blocked joints.
const READ: Span = Span::between(&FINE_POSITION, &BLOCKED_JOINTS);
/// The state of an arm that has not replied yet.
const UNMEASURED: FineState = FineState { positions: [None; 7], velocities: [0; 7], loads: [0; 7] };

/// An arm, and what its host knows of it.
#[derive(Clone, Debug)]
pub(crate) struct SteppedArm {
    pub(crate) simulation: Simulation,
    pub(crate) seed: u64,
    /// The set-point period that [`Self::send`] wrote last, in milliseconds.
    period: Option<u16>,
    state: FineState,
    /// Bit n-1 is joint n.
    blocked: u8,
    /// When the last reply came.
    heard: Instant,
}

impl SteppedArm {
    pub(crate) const fn new(simulation: Simulation, seed: u64) -> Self {
        let heard = simulation.now();
        Self { simulation, seed, period: None, state: UNMEASURED, blocked: 0, heard }
    }

    /// Makes the arm a copy of `other`. The faults of its line follow from its own seed.
    pub(crate) fn become_copy(&mut self, other: &Simulation) {
        *self = Self::new(other.clone(), self.seed);
        self.simulation.set_seed(self.seed);
        self.simulation.set_paced(false);
        self.observe();
    }

    /// Sends the targets as the next point of a stream, if there are any, lets `milliseconds` pass, and asks for the state.
    pub(crate) fn step(&mut self, targets: Option<[FineAngle; 7]>, milliseconds: u16) {
        if let Some(targets) = targets {
            self.send(targets, milliseconds);
        }
        self.simulation.advance(Duration::from_millis(milliseconds.into()));
        self.observe();
    }

    /// Sends the targets as the next point of a stream of this period in milliseconds.
    pub(crate) fn send(&mut self, targets: [FineAngle; 7], period: u16) {
        self.write_period(period);
        let [a, b, c, d, e, f, g] = targets.map(|target| target.hundredths().to_le_bytes());
        self.write(FINE_TARGET.address, [a, b, c, d, e, f, g].as_flattened());
    }

    fn write_period(&mut self, milliseconds: u16) {
        if self.period != Some(milliseconds) {
            self.write(SET_POINT_PERIOD.address, &milliseconds.to_le_bytes());
            self.period = Some(milliseconds);
        }
    }

    /// Writes registers in one frame. The arm may refuse it.
    pub(crate) fn write(&mut self, address: u8, values: &[u8]) {
        self.simulation.send_request(&Request::Write { address, values });
    }

    /// Asks for the state. If the reply is lost or late, the last state stays.
    pub(crate) fn observe(&mut self) {
        self.simulation.send_request(&Request::Read { address: READ.address(), count: READ.count() });
        let received = self.simulation.take_received();
        let mut rest = received.as_slice();
        while !rest.is_empty() {
            let taken = match parse::<ToHost>(rest) {
                ParseOutcome::Complete(frame, length) => {
                    Reply::from_frame(frame).into_iter().for_each(|reply| self.note(&reply));
                    length
                }
                ParseOutcome::Incomplete(_) | ParseOutcome::Defective(..) | ParseOutcome::NotAFrame => 1,
            };
            rest = rest.get(taken..).unwrap_or_default();
        }
    }

    fn note(&mut self, reply: &Reply<'_>) {
        if reply.address != READ.address() || reply.values.len() != usize::from(READ.count()) {
            return;
        }
        let snapshot = Snapshot { address: reply.address, values: reply.values.to_vec() };
        self.state = FineState::new(&snapshot);
        self.blocked = snapshot.byte(&BLOCKED_JOINTS);
        self.heard = self.simulation.now();
    }

    pub(crate) const fn state(&self) -> &FineState {
        &self.state
    }

    pub(crate) const fn blocked(&self) -> u8 {
        self.blocked
    }

    /// The time since the last reply.
    pub(crate) fn age(&self) -> Duration {
        self.simulation.now() - self.heard
    }
}

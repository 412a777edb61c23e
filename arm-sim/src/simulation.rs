//! An arm with a clock of its own, for programs that do not run in real time: tests, learning, a browser.
//!
//! ```
//! use arm_sim::request::Request;
//! use arm_sim::{Duration, Joint, Simulation};
//!
//! let mut arm = Simulation::default();
//! arm.advance(Duration::from_millis(1_000));
//! // Move joint 1 to 120 degrees. The three seconds pass in virtual time.
//! arm.send_request(&Request::Write { address: 46, values: &[120] });
//! arm.advance(Duration::from_millis(3_000));
//! assert_eq!(arm.plant().angle(Joint::ALL[0]) / 1_000, 120);
//! assert_eq!(arm.now().as_micros(), 4_000_000);
//! ```
//!
//! A copy is a snapshot:
//!
//! ```
//! use arm_sim::{Duration, Joint, ServoFault, Simulation};
//!
//! let mut arm = Simulation::default();
//! arm.advance(Duration::from_millis(1_000));
//! let before = arm.clone();
//! arm.plant_mut().set_fault(Joint::ALL[2], Some(ServoFault::Missing));
//! arm.advance(Duration::from_millis(1_000));
//! assert_ne!(arm.registers().get(241), before.registers().get(241), "register 241 holds the faults");
//! arm = before;
//! assert_eq!(arm.now().as_micros(), 1_000_000);
//! ```

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use motion_core::Controller;
use protocol_core::registers::RegisterFile;
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;

use crate::action::Action;
use crate::controller::ArmController;
use crate::faults::{ArmFault, FaultLocation, FaultReport};
use crate::flash::{Flash, Memory};
use crate::plant::Plant;
use crate::servo::ServoConfig;
use crate::session::SessionRecorder;
use crate::simulated_arm::{ArmConfig, SimulatedArm};
use crate::tap::Tap;

/// The arm's bytes are taken off the host line at least this often, so that the line seldom fills up.
const TAKE_PERIOD: Duration = Duration::from_millis(10);

/// What [`Simulation::power_up`] starts an arm with.
#[derive(Clone, Debug)]
pub struct SimulationConfig {
    /// The chip id, most significant byte first ([D8](protocol_core::decisions#d8)).
    pub chip_id: [u8; 6],
    /// Bytes on the host line take the time that the baud rate requires. Otherwise they arrive at once.
    pub is_paced: bool,
    /// The make of the servos.
    pub servos: ServoConfig,
    /// The settings of the arm; by default the factory settings.
    pub settings: Memory,
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            chip_id: *b"SIM\0\0\x01",
            is_paced: true,
            servos: ServoConfig::default(),
            settings: Memory::default(),
        }
    }
}

/// An arm in virtual time, with the controller `C`. The same calls give the same bytes on every machine.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Simulation<C = Controller> {
    arm: SimulatedArm<Flash, Plant, C>,
    now: Instant,
    /// Bytes of the host that the line has not accepted yet.
    to_send: VecDeque<u8>,
    /// Bytes that have arrived at the host.
    received: Vec<u8>,
    /// Planned actions, and when to carry them out.
    planned: Vec<(Instant, Action)>,
}

impl Default for Simulation {
    fn default() -> Self {
        Self::new(SimulationConfig::default())
    }
}

impl Simulation {
    /// Switches an arm with this project's controller on, at time 0.
    #[must_use]
    pub fn new(config: SimulationConfig) -> Self {
        Self::power_up(config)
    }

    /// The register file of the controller.
    #[must_use]
    pub fn registers(&self) -> &RegisterFile {
        self.arm.registers()
    }
}

impl<C: ArmController> Simulation<C> {
    /// Switches an arm on, at time 0.
    #[must_use]
    pub fn power_up(config: SimulationConfig) -> Self {
        let SimulationConfig { chip_id, is_paced, servos, settings } = config;
        let config = ArmConfig { chip_id, is_paced, torque_codes: servos.torque_codes };
        let plant = Plant::with_config(Instant::ZERO, servos);
        let arm = SimulatedArm::power_up(Instant::ZERO, config, Flash::on(settings), plant);
        Self { arm, now: Instant::ZERO, to_send: VecDeque::new(), received: Vec::new(), planned: Vec::new() }
    }

    /// The virtual time since [`Simulation::power_up`].
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Do bytes on the host line take the time that the baud rate requires?
    #[must_use]
    pub const fn is_paced(&self) -> bool {
        self.arm.is_paced()
    }

    /// Sets [`Self::is_paced`]. A change drops the bytes on the line.
    pub fn set_paced(&mut self, is_paced: bool) {
        self.arm.set_paced(is_paced);
    }

    /// The host starts to send these bytes now.
    pub fn send(&mut self, bytes: &[u8]) {
        self.to_send.extend(bytes);
        self.pass_bytes();
    }

    /// The host starts to send this request now.
    pub fn send_request(&mut self, request: &Request<'_>) {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        self.send(&frame);
    }

    /// Takes the bytes that have arrived at the host since the last call.
    pub fn take_received(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.received)
    }

    /// Lets time pass, and carries out the planned actions that become due.
    pub fn advance(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.advance_to(end);
        }
    }

    /// Lets time pass until the condition holds, at most for `timeout`. The condition is checked after each event. Returns
    /// whether it holds.
    ///
    /// ```
    /// use arm_sim::request::Request;
    /// use arm_sim::{Duration, Simulation};
    ///
    /// let mut arm = Simulation::default();
    /// arm.send_request(&Request::Read { address: 54, count: 7 });
    /// let second = Duration::from_millis(1_000);
    /// assert!(arm.advance_until(second, |arm| arm.received().len() == 14));
    /// assert!(arm.now().as_micros() < 3_000, "21 bytes at 115200 baud");
    /// ```
    pub fn advance_until(&mut self, timeout: Duration, mut condition: impl FnMut(&Self) -> bool) -> bool {
        let end = self.now + timeout;
        loop {
            if condition(self) {
                return true;
            }
            if self.now >= end {
                return false;
            }
            self.advance_to(end.min(self.arm.next_event()));
        }
    }

    /// The bytes that have arrived at the host since [`Simulation::take_received`].
    #[must_use]
    pub fn received(&self) -> &[u8] {
        &self.received
    }

    /// Lets time pass towards `end`: at most for [`TAKE_PERIOD`], and not past the next planned action.
    fn advance_to(&mut self, end: Instant) {
        let planned = self.planned.iter().map(|(time, _)| *time).min().unwrap_or(end);
        self.now = end.min(self.now + TAKE_PERIOD).min(planned.max(self.now));
        self.arm.advance(self.now, self.to_send.is_empty());
        while let Some(due) = self.planned.iter().position(|(time, _)| *time <= self.now) {
            let (_, action) = self.planned.remove(due);
            self.act(action);
        }
        self.pass_bytes();
    }

    fn pass_bytes(&mut self) {
        while !self.to_send.is_empty() {
            let (piece, _) = self.to_send.as_slices();
            let sent = self.arm.host_send(self.now, piece);
            if sent == 0 {
                break;
            }
            self.to_send.drain(..sent);
        }
        while !self.arm.host_received().is_empty() {
            self.received.extend(self.arm.host_received());
            self.arm.host_take(self.arm.host_received().len());
        }
    }

    /// The simulated servos, and the arm that they carry.
    #[must_use]
    pub const fn plant(&self) -> &Plant {
        self.arm.plant()
    }

    /// The simulated servos, for example to set a fault.
    pub const fn plant_mut(&mut self) -> &mut Plant {
        self.arm.plant_mut()
    }

    /// Switches the arm off and on. RAM and the bytes on the host line are lost; the settings stay.
    pub fn power_cycle(&mut self) {
        self.to_send.clear();
        self.arm.power_cycle(self.now);
    }

    /// Restarts the controller, as its watchdog does. RAM and the bytes on the host line are lost. The servos keep power, torque
    /// and goals. Has no effect while the arm is off.
    pub fn restart_controller(&mut self) {
        self.to_send.clear();
        self.arm.restart_controller(self.now);
    }

    /// Stops the controller, as if its program hung, until [`Simulation::restart_controller`] or
    /// [`Simulation::power_cycle`]. The servos keep their goals.
    pub fn halt_controller(&mut self) {
        self.arm.halt_controller(self.now);
    }

    /// The host closes its port: bytes on the line to it are lost, and this project's controller ends the reports
    /// ([M12](protocol_core::decisions#m12)).
    pub fn disconnect(&mut self) {
        self.arm.host_disconnect();
    }

    /// Switches the arm off, until [`Simulation::power_cycle`]. RAM and the bytes on the host line are lost. Loaded joints fall.
    pub fn power_off(&mut self) {
        self.to_send.clear();
        self.arm.power_off(self.now);
    }

    /// Adds a fault, for `duration` or until it is removed. Returns the report of the fault that it replaces.
    ///
    /// ```
    /// use arm_sim::{Duration, Simulation};
    ///
    /// let mut arm = Simulation::default();
    /// let second = Duration::from_millis(1_000);
    /// arm.set_fault("3=garbled=10".parse()?, Some(second));
    /// arm.advance(second);
    /// let [report] = arm.take_ended_faults().try_into().map_err(|_| "one fault")?;
    /// assert!(!report.had_no_effect(), "{report}");
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn set_fault(&mut self, fault: ArmFault, duration: Option<Duration>) -> Option<FaultReport> {
        self.arm.set_fault(self.now, fault, duration)
    }

    /// Removes the faults at a location, or all faults with `None`. Returns their reports.
    pub fn end_faults(&mut self, location: Option<FaultLocation>) -> Vec<FaultReport> {
        self.arm.end_faults(self.now, location)
    }

    /// The faults of the arm, and how often they took effect so far.
    pub fn faults(&mut self) -> Vec<FaultReport> {
        self.arm.faults()
    }

    /// Takes the reports of the faults that have ended by themselves since the last call; of more than 16, the last 16.
    pub fn take_ended_faults(&mut self) -> Vec<FaultReport> {
        self.arm.take_ended_faults()
    }

    /// Sets the seed of the random faults of the host line, 1 by default. The bytes on the host line are lost, and the counts of
    /// its faults begin again at 0.
    pub fn set_seed(&mut self, seed: u64) {
        self.arm.set_seed(seed);
    }

    /// Carries out an action. Returns the reports of the faults that it ended.
    pub fn act(&mut self, action: Action) -> Vec<FaultReport> {
        self.arm.act(self.now, action)
    }

    /// Plans an action for this time from now. It is carried out while time passes, also in [`Simulation::advance_until`].
    ///
    /// ```
    /// use arm_sim::{Duration, Simulation};
    ///
    /// let mut arm = Simulation::default();
    /// arm.plan(Duration::from_millis(1_500), "fault 3=missing".parse()?);
    /// arm.advance(Duration::from_millis(1_499));
    /// assert!(arm.faults().is_empty());
    /// arm.advance(Duration::from_millis(1));
    /// assert_eq!(arm.faults().len(), 1);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn plan(&mut self, after: Duration, action: Action) {
        self.planned.push((self.now + after, action));
    }

    /// Passes the inputs of the arm, and the bytes that the host takes, to `recorder` from now on: see [`crate::session`].
    /// Changes by [`Simulation::plant_mut`] and [`Simulation::set_paced`] are not recorded. A copy of the simulation has no
    /// recorder.
    pub fn set_recorder(&mut self, recorder: impl SessionRecorder + 'static) {
        self.arm.set_recorder(recorder);
    }

    /// Copies the bytes on the host line to `tap` from now on. A copy of the simulation has no tap.
    pub fn set_tap(&mut self, tap: impl Tap + 'static) {
        self.arm.set_tap(tap);
    }
}

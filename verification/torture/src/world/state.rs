//! The data of a world. The other files of this folder add its behaviour.

use std::collections::VecDeque;

use motion_core::Controller;
use protocol_core::registers::Joint;
use protocol_core::time::Instant;

use super::command_checker::CommandChecker;
use super::disturbed_bus::DisturbedBus;
use super::event_log::EventLog;
use super::host_link::{ArmToHost, HostToArm};
use super::host_request::HostRequest;
use super::let_go_rule::LetGoRule;
use super::outside_ending::Ending;
use super::parameters::WorldParameters;
use super::register_model::{RegisterModel, RequestEffect};
use super::request_generator::RequestGenerator;
use super::settings_storage::SettingsStorage;
use super::status_checker::{StatusChecker, StatusContext};
use super::supply_rule::SupplyRule;
use super::watchdog_model::WatchdogModel;
use crate::scenario::Scenario;
use crate::seeded_rng::SeededRng;
use crate::world_counts::WorldCounts;

/// One arm with its servos, its flash and its host.
#[derive(Debug)]
pub struct TortureWorld {
    pub(super) seed: u64,
    pub(super) scenario: &'static Scenario,
    pub(super) now: Instant,
    pub(super) rng: SeededRng,
    pub(super) parameters: WorldParameters,
    pub(super) bus: DisturbedBus,
    pub(super) storage: Box<dyn SettingsStorage>,
    pub(super) generator: RequestGenerator,
    pub(super) power: PowerState,
    /// True if the motor state is servo, or was when the controller stopped.
    pub(super) is_servo: bool,
    /// The shell does not run before this time.
    pub(super) stalled_until: Instant,
    pub(super) next_fault_at: Instant,
    pub(super) hand: Option<Hand>,
    /// The pending ends and repetitions of influences from outside the arm, each with its time.
    pub(super) endings: Vec<(Instant, Ending)>,
    pub(super) supply_rule: SupplyRule,
    pub(super) log: EventLog,
    pub(super) counts: WorldCounts,
}

/// The power supply of the controller.
#[derive(Debug)]
pub(super) enum PowerState {
    On(Box<PoweredArm>),
    Off {
        until: Instant,
        servos_too: bool,
    },
    /// A step of the simulation has taken the powered arm out. At the end of the step the state is `On` or `Off` again.
    Taken,
}

/// The state from power-up to power-down: the controller, its host link and its checkers.
#[derive(Debug)]
pub(super) struct PoweredArm {
    pub(super) controller: Controller,
    /// The bytes of the last output.
    pub(super) output_bytes: Vec<u8>,
    /// The effect of the last request, until its reply, alarm or save.
    pub(super) owed: Option<RequestEffect>,
    pub(super) model: RegisterModel,
    pub(super) watchdog: WatchdogModel,
    pub(super) command_checker: CommandChecker,
    pub(super) status_checker: StatusChecker,
    pub(super) let_go_rule: LetGoRule,
    pub(super) to_arm: HostToArm,
    pub(super) to_host: ArmToHost,
    pub(super) pending: VecDeque<PendingRequest>,
    /// The shell's loop runs next at this time.
    pub(super) wake_at: Instant,
    /// The next save is interrupted by a power cut.
    pub(super) cuts_next_save: bool,
    /// Consecutive waits whose deadline had already passed.
    pub(super) expired_waits: u32,
}

impl PoweredArm {
    /// Calls the status checker with the present state.
    pub(super) fn check_status<T>(
        &mut self,
        now: Instant,
        bus: &DisturbedBus,
        check: impl FnOnce(&mut StatusChecker, &StatusContext<'_>) -> T,
    ) -> T {
        let Self { controller, model, watchdog, command_checker, status_checker, .. } = self;
        let registers = controller.registers();
        check(status_checker, &StatusContext { now, registers, model, watchdog, bus, command_checker })
    }
}

/// A request that the arm has not executed yet.
#[derive(Debug)]
pub(super) struct PendingRequest {
    pub(super) request: HostRequest,
    /// The arrival time of its last byte.
    pub(super) arrived_at: Instant,
}

/// A hand that turns a joint.
#[derive(Debug)]
pub(super) struct Hand {
    pub(super) joint: Joint,
    /// Position in thousandths of a count.
    pub(super) millicounts: i64,
    pub(super) step: i64,
    pub(super) until: Instant,
    pub(super) next_at: Instant,
}

//! Power-up, power-down, and what one arm's world has that another's has not.

use arm_sim::plant;
use flash_model::{Cut, EraseTear, ProgramTear};
use motion_core::{Config, Controller, TorqueCodes};
use protocol_core::registers::map::baud_rate;
use protocol_core::time::{Duration, Instant};
use std::collections::VecDeque;

use super::audit::Audit;
use super::commands::Commands;
use super::line::{ToArm, ToHost};
use super::model::Model;
use super::settings::{End, Flashed, Found, REAL, Settings};
use super::{Life, World};
use crate::dice::Dice;
use crate::violation::{Check, ensure};

/// The chip id of every arm here.
const CHIP_ID: [u8; 6] = [1, 2, 3, 4, 5, 6];

/// Is the controller on?
#[derive(Debug)]
pub(super) enum Power {
    On(Box<Life>),
    Off {
        until: Instant,
        servos_too: bool,
    },
    /// In between, for the length of a step.
    None,
}

/// What the reference board keeps between two frames of the servo bus.
const GUARD_TIME: Duration = Duration::from_micros(100);

/// What differs from world to world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Traits {
    sector: usize,
    servo_timeout: Duration,
    torque_codes: TorqueCodes,
    /// After a servo's own start, a goal switches its torque on.
    goal_starts_torque: bool,
    /// The shell wakes up so much too late, at most.
    pub(super) jitter: Duration,
    /// Does the shell hand over bytes before every poll, or once before all?
    pub(super) receives_before_every_poll: bool,
}

impl Traits {
    pub(super) fn draw(dice: &mut Dice) -> Self {
        let millis = |millis: u64| Duration::from_millis(millis);
        let jitters = [0, 0, 20, 200, 1_000, 5_000];
        Self {
            sector: dice.one_of(&[512, 2_048, REAL], REAL),
            servo_timeout: millis(dice.one_of(&[3, 3, 5, 20, 50], 3)),
            torque_codes: dice.one_of(
                &[TorqueCodes::DampingOnFree, TorqueCodes::FreeOnDamping],
                TorqueCodes::DampingOnFree,
            ),
            jitter: Duration::from_micros(dice.one_of(&jitters, 0)),
            receives_before_every_poll: dice.one_in(2),
            goal_starts_torque: dice.one_in(2),
        }
    }

    pub(super) fn plant(&self) -> plant::Settings {
        plant::Settings {
            torque_codes: self.torque_codes,
            goal_starts_torque: self.goal_starts_torque,
            ..plant::Settings::default()
        }
    }

    /// A servo that is no later than the first answers in time, one that is later than the second never does.
    pub(super) fn bounds_of_lateness(&self) -> [Duration; 2] {
        let timeout = self.servo_timeout.as_micros();
        let too_late = timeout + self.jitter.as_micros() + 2_000;
        [timeout / 2, too_late].map(Duration::from_micros)
    }

    pub(super) fn settings(&self) -> Box<dyn Settings> {
        match self.sector {
            512 => Box::new(Flashed::<512>::new()),
            2_048 => Box::new(Flashed::<2_048>::new()),
            _ => Box::new(Flashed::<REAL>::new()),
        }
    }
}

/// Any way to cut the power at one of the next operations of the flash.
pub(super) fn any_cut(operations: usize, dice: &mut Dice) -> Cut {
    Cut {
        after: dice.below(operations),
        program: dice.one_of(&ProgramTear::ALL, ProgramTear::All),
        erase: dice.one_of(&EraseTear::ALL, EraseTear::All),
        seed: dice.any(),
    }
}

impl World {
    pub(super) fn power_up(&mut self, servos_too: bool) -> Check {
        if servos_too {
            self.servos.power_cycle(self.now);
        }
        let is_cut = self.dice.below(100) < usize::try_from(self.scenario.cut_starts_percent).unwrap_or(0);
        let cut = is_cut.then(|| any_cut(20, &mut self.dice));
        match self.settings.start(self.dice.any(), cut)? {
            End::Done(found) => self.begin_life(found),
            End::Cut => {
                self.tally.cuts += 1;
                self.tally.cut_starts += 1;
                self.notes.event(self.now, "power cut during start".to_owned());
                self.power = self.off(true);
                Ok(())
            }
        }
    }

    fn begin_life(&mut self, found: Found) -> Check {
        let now = self.now;
        let config = Config {
            chip_id: CHIP_ID,
            faults: 0,
            servo_timeout: self.traits.servo_timeout,
            guard_time: GUARD_TIME,
            torque_codes: self.traits.torque_codes,
        };
        self.notes.event(now, format!("power on, {found:?}"));
        let controller = Controller::new(now, config, found.image.as_ref(), found.storage);
        let model = Model::new(CHIP_ID, found.image.as_ref(), found.storage);
        model.compare(controller.registers())?;
        let baud = controller.baud();
        ensure(baud == baud_rate(model.baud_code()), || format!("{baud} baud"))?;
        self.client.start_over(now);
        self.stalled_until = now;
        self.power = Power::On(Box::new(Life {
            controller,
            said: Vec::new(),
            model,
            commands: Commands::new(now, self.servos.torque_codes(), self.traits.servo_timeout),
            audit: Audit::new(now),
            to_arm: ToArm::new(baud),
            to_host: ToHost::new(baud, now),
            pending: VecDeque::new(),
            due: now,
            save_is_cut: false,
            hasty_waits: 0,
        }));
        Ok(())
    }

    /// The controller is gone, and with it what was on its way.
    pub(super) fn power_down(&mut self, life: &Life, servos_too: bool) {
        self.tally.cuts += 1;
        self.tally.commands += life.commands.count;
        self.tally.engagements += life.commands.engagements;
        if !servos_too {
            self.servos.restarted_at = self.now;
        }
        let what = if servos_too { "power cut" } else { "restart" };
        self.notes.event(self.now, format!("{what}, {} requests under way", life.pending.len()));
        self.power = self.off(servos_too);
    }

    fn off(&mut self, servos_too: bool) -> Power {
        let time = self.dice.any_scale(Duration::from_micros(100), Duration::from_millis(3_000));
        Power::Off { until: self.now + time, servos_too }
    }
}

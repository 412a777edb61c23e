//! The parameters that differ between worlds: sector size, servo timeout, torque codes, the effect of a servo's first goal, and
//! the shell's timing.

use arm_sim::servo::ServoConfig;
use motion_core::TorqueCodes;
use protocol_core::time::Duration;

use super::settings_storage::{BOARD_SECTOR, FlashSettings, SettingsStorage};
use crate::seeded_rng::SeededRng;

#[derive(Clone, Copy, Debug)]
pub(super) struct WorldParameters {
    /// Bytes of a flash sector.
    sector: usize,
    pub(super) servo_timeout: Duration,
    pub(super) torque_codes: TorqueCodes,
    /// True if the first goal after a restart of a servo switches its torque on.
    goal_starts_torque: bool,
    /// The largest delay of a wake-up of the shell.
    pub(super) jitter: Duration,
    /// True if the shell delivers host bytes before every poll, false if only before the first one and after a wait.
    pub(super) receives_before_every_poll: bool,
}

impl WorldParameters {
    pub(super) fn draw(rng: &mut SeededRng) -> Self {
        let jitters_us = [0, 0, 20, 200, 1_000, 5_000];
        Self {
            sector: rng.one_of(&[512, 2_048, BOARD_SECTOR], BOARD_SECTOR),
            servo_timeout: Duration::from_millis(rng.one_of(&[3, 3, 5, 20, 50], 3)),
            torque_codes: rng.one_of(
                &[TorqueCodes::DampingOnFree, TorqueCodes::FreeOnDamping],
                TorqueCodes::DampingOnFree,
            ),
            jitter: Duration::from_micros(rng.one_of(&jitters_us, 0)),
            receives_before_every_poll: rng.one_in(2),
            goal_starts_torque: rng.one_in(2),
        }
    }

    pub(super) fn plant(&self) -> ServoConfig {
        ServoConfig {
            torque_codes: self.torque_codes,
            goal_starts_torque: self.goal_starts_torque,
            ..ServoConfig::default()
        }
    }

    /// The largest delay with which every reply of a servo is in time, and the smallest delay with which each is too late.
    pub(super) fn reply_time_bounds(&self) -> [Duration; 2] {
        let timeout = self.servo_timeout.as_micros();
        let late = timeout + self.jitter.as_micros() + 2_000;
        [timeout / 2, late].map(Duration::from_micros)
    }

    pub(super) fn storage(&self) -> Box<dyn SettingsStorage> {
        match self.sector {
            512 => Box::new(FlashSettings::<512>::new()),
            2_048 => Box::new(FlashSettings::<2_048>::new()),
            _ => Box::new(FlashSettings::<BOARD_SECTOR>::new()),
        }
    }
}

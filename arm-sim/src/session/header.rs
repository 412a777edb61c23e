//! The first two lines of a session: the kind of arm and its initial state.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::{self, Display, Formatter};

use motion_core::servo_bus::TorqueCodes;

use super::{Hex, VERSION, bytes_from_hex};
use crate::simulation::SimulationConfig;

/// The controller of a recorded arm. A [`Replay`](crate::replay::Replay) starts the same one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControllerKind {
    /// The controller of this project.
    Sevenbot,
    /// The maker's controller, [`StockController`](crate::stock_controller::StockController).
    Maker,
}

/// The kind of the recorded arm, and its initial state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SessionHeader {
    /// The version of the program that recorded the session.
    pub program: String,
    /// The controller of the arm: `controller=sevenbot` or `controller=maker`.
    pub controller: ControllerKind,
    /// The seed of the random faults of the host line.
    pub seed: u64,
    /// The chip id of the arm, most significant byte first.
    pub chip_id: [u8; 6],
    /// Do bytes on the host line take the time that the baud rate requires?
    pub is_paced: bool,
    /// Does each byte on the host line have its own deadline? See
    /// [`SimulatedArm::set_bytewise_line`](crate::simulated_arm::SimulatedArm::set_bytewise_line).
    pub is_bytewise: bool,
    /// The meaning of the codes in the servos' torque switch.
    pub torque_codes: TorqueCodes,
    /// The bytes of the settings, without erased ones at the end.
    pub settings: Vec<u8>,
}

impl Default for SessionHeader {
    fn default() -> Self {
        let SimulationConfig { chip_id, is_paced, servos, settings } = SimulationConfig::default();
        Self {
            program: env!("CARGO_PKG_VERSION").into(),
            controller: ControllerKind::Sevenbot,
            seed: 1,
            chip_id,
            is_paced,
            is_bytewise: false,
            torque_codes: servos.torque_codes,
            settings: settings.bytes().to_vec(),
        }
    }
}

impl Display for SessionHeader {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let controller = match self.controller {
            ControllerKind::Sevenbot => "sevenbot",
            ControllerKind::Maker => "maker",
        };
        let codes = match self.torque_codes {
            TorqueCodes::DampingOnFree => "older",
            TorqueCodes::FreeOnDamping => "current",
        };
        let Self { program, seed, chip_id, is_paced, is_bytewise, settings, .. } = self;
        writeln!(
            out,
            "7bot-session {VERSION} program={program} controller={controller} seed={seed} chip-id={} \
             paced={is_paced} bytewise={is_bytewise} torque-codes={codes}",
            Hex(chip_id)
        )?;
        write!(out, "settings {}", Hex(settings))
    }
}

/// Why the first two lines are not the header of a session.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HeaderError {
    /// The text is not a session of this version of the format.
    #[error(
        "it does not begin with '7bot-session {VERSION}', as what `host-sim --record` writes. `sevenbot sniff FILE` shows \
         a log of `sevenbot log` or `--log`"
    )]
    NoSession,
    /// A value is missing or wrong.
    #[error("the value of {0} in its first two lines is missing or wrong: record the session again")]
    Value(&'static str),
}

impl SessionHeader {
    /// Parses the first two lines.
    ///
    /// # Errors
    /// The lines are not the header of a session of this version, or a value is missing or wrong.
    pub fn parse(first: &str, second: &str) -> Result<Self, HeaderError> {
        let mut words = first.split(' ');
        let is_ours = words.next() == Some("7bot-session")
            && words.next().and_then(|version| version.parse().ok()) == Some(VERSION);
        if !is_ours {
            return Err(HeaderError::NoSession);
        }
        let values: Vec<(&str, &str)> = words.filter_map(|word| word.split_once('=')).collect();
        let value = |name: &'static str| {
            let found = values.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| *value).ok_or(HeaderError::Value(name))
        };
        let settings = second.strip_prefix("settings ").or((second == "settings").then_some(""));
        let settings = settings.and_then(|digits| bytes_from_hex(digits).ok());
        let chip_id = bytes_from_hex(value("chip-id")?).ok().and_then(|id| id.try_into().ok());
        Ok(Self {
            program: value("program")?.into(),
            controller: match value("controller")? {
                "sevenbot" => ControllerKind::Sevenbot,
                "maker" => ControllerKind::Maker,
                _ => return Err(HeaderError::Value("controller")),
            },
            seed: value("seed")?.parse().map_err(|_| HeaderError::Value("seed"))?,
            chip_id: chip_id.ok_or(HeaderError::Value("chip-id"))?,
            is_paced: value("paced")?.parse().map_err(|_| HeaderError::Value("paced"))?,
            is_bytewise: value("bytewise")?.parse().map_err(|_| HeaderError::Value("bytewise"))?,
            torque_codes: match value("torque-codes")? {
                "older" => TorqueCodes::DampingOnFree,
                "current" => TorqueCodes::FreeOnDamping,
                _ => return Err(HeaderError::Value("torque-codes")),
            },
            settings: settings.ok_or(HeaderError::Value("settings"))?,
        })
    }
}

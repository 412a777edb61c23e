//! Serial ports, and which of them lead to an arm.

use pyo3::prelude::*;
use sevenbot::Identity;
use sevenbot::network::{Address, is_token};
use sevenbot::ports::{ProbeResult, probe, reachable};

use crate::arguments::{PortName, baud_rate, whole};
use crate::errors::{InvalidType, InvalidValue, PortError, error};

/// Name, description, number, firmware and chip.
type Found = (String, String, u8, String, String);

/// The arms of this machine: port, description, device id (register 11), firmware version and `chip_id`. Their ports are serial
/// ports, or servers of this user (`sevenbot serve`).
///
/// Asks all ports at the same time, at `baud` bits per second, for about half a second.
#[pyfunction]
#[pyo3(signature = (baud = 115_200))]
pub(crate) fn ports(py: Python<'_>, baud: i64) -> PyResult<Vec<Found>> {
    let baud = baud_rate(py, baud)?;
    let found = py.detach(|| probe(reachable(), baud));
    let arms = found.into_iter().filter_map(|found| {
        let (identity, id) = found.answer.ok()?;
        Some((found.port.name, found.port.description, id, identity.version(), identity.chip_name()))
    });
    Ok(arms.collect())
}

/// Checks a token: its characters, and that `port` is the address of a server that takes one.
pub(crate) fn token(py: Python<'_>, port: &str, token: Option<String>) -> PyResult<Option<String>> {
    let Some(token) = token else { return Ok(None) };
    if !is_token(&token) {
        return Err(InvalidValue::raise(
            py,
            "token: use 8 to 128 letters, digits and punctuation marks, without spaces",
        ));
    }
    if Address::parse(port).is_some_and(|address| address.takes_token()) {
        return Ok(Some(token));
    }
    Err(InvalidType::raise(
        py,
        "a token goes with a port as \"tcp://HOST:PORT\", \"tls://HOST:PORT\" or \"sevenbot://NAME\"",
    ))
}

/// The arm that is wanted: its number (register 11), its chip, or any.
#[derive(Default)]
pub(crate) struct Wanted {
    id: Option<u8>,
    chip: Option<String>,
}

impl Wanted {
    pub(crate) fn of(py: Python<'_>, id: Option<i64>, chip: Option<&str>) -> PyResult<Self> {
        let id = id.map(|id| whole(py, "id", id, 0, 255)).transpose()?;
        Ok(Self { id, chip: chip.map(str::to_ascii_uppercase) })
    }

    /// The port of this name, or the only port with the wanted arm.
    pub(crate) fn port(&self, py: Python<'_>, named: Option<PortName>, baud: u32) -> PyResult<String> {
        match named {
            Some(_) if self.id.is_some() || self.chip.is_some() => {
                Err(InvalidType::raise(py, "give a port, or the id or the chip of an arm, not both"))
            }
            Some(PortName(name)) => Ok(name),
            None => self.only_one(py, baud),
        }
    }

    fn is(&self, identity: &Identity, id: u8) -> bool {
        let is_chip = |chip: &String| identity.chip_name().to_ascii_uppercase() == *chip;
        self.id.is_none_or(|wanted| wanted == id) && self.chip.as_ref().is_none_or(is_chip)
    }

    fn only_one(&self, py: Python<'_>, baud: u32) -> PyResult<String> {
        let found = py.detach(|| probe(reachable(), baud));
        let is_wanted =
            |found: &ProbeResult| found.answer.as_ref().is_ok_and(|(identity, id)| self.is(identity, *id));
        let names: Vec<_> = found.into_iter().filter(is_wanted).map(|found| found.port.name).collect();
        match names.as_slice() {
            [name] => Ok(name.clone()),
            [] => Err(self.none(py)),
            several => {
                let message = format!("several arms answer: {}", several.join(", "));
                Err(error::<PortError>(py, &message, &["name one of these ports".to_owned()]))
            }
        }
    }

    fn none(&self, py: Python<'_>) -> PyErr {
        let hints = [
            "is the arm plugged in, and has it power? A simulator's port has to be named",
            "is the baud rate right (baud=)?",
            "`sevenbot ports` lists the ports",
        ];
        let id = self.id.map(|id| format!(" with id {id}"));
        let chip = self.chip.as_ref().map(|chip| format!(" with chip {chip}"));
        let which = [id, chip].into_iter().flatten().collect::<String>();
        error::<PortError>(py, &format!("no port has an arm{which} that answers"), &hints.map(str::to_owned))
    }
}

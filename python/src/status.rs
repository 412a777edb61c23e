//! `Status`: the status block of an arm.

use pyo3::prelude::*;
use sevenbot::register_text::{faults, joints, refusal_reason};
use sevenbot::{Joint, StatusBlock};

use crate::tip::html_table;

/// The status block at one instant. Only this project's firmware has one.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Status(StatusBlock);

impl From<StatusBlock> for Status {
    fn from(block: StatusBlock) -> Self {
        Self(block)
    }
}

impl Status {
    fn rows(&self) -> [(&'static str, String); 7] {
        let unknown = || "unknown".to_owned();
        [
            ("faults", faults(self.0.faults())),
            ("not answering", joints(self.0.missing())),
            ("moving", joints(self.0.moving())),
            ("supply", self.0.supply_volts().map_or_else(unknown, |volts| format!("{volts:.1} V"))),
            (
                "hottest servo",
                self.0.hottest_celsius().map_or_else(unknown, |degrees| format!("{degrees} °C")),
            ),
            ("frames accepted, corrupted, refused", {
                format!(
                    "{}, {}, {}",
                    self.0.frames_accepted(),
                    self.0.frames_corrupted(),
                    self.0.frames_refused()
                )
            }),
            ("last refusal", self.last_refusal().unwrap_or("none").to_owned()),
        ]
    }
}

#[pymethods]
impl Status {
    /// Is there no fault, and does every servo answer?
    #[getter]
    fn is_healthy(&self) -> bool {
        self.0.is_healthy()
    }

    /// The faults as text; `"none"` without any.
    #[getter]
    fn faults(&self) -> String {
        faults(self.0.faults())
    }

    /// The bits of register 241.
    #[getter]
    fn fault_bits(&self) -> u8 {
        self.0.faults()
    }

    /// The joints, 1 to 7, whose servo does not answer.
    #[getter]
    fn missing(&self) -> Vec<u16> {
        numbers(self.0.missing())
    }

    /// The joints, 1 to 7, whose set-point moves.
    #[getter]
    fn moving(&self) -> Vec<u16> {
        numbers(self.0.moving())
    }

    /// The supply of the servos in volts; `None` if unknown.
    #[getter]
    fn supply_volts(&self) -> Option<f64> {
        self.0.supply_volts()
    }

    /// The temperature of the hottest servo in degrees Celsius; `None` if unknown.
    #[getter]
    fn hottest_celsius(&self) -> Option<u8> {
        self.0.hottest_celsius()
    }

    /// The number of accepted frames, 0 to 65535; wraps.
    #[getter]
    fn frames_accepted(&self) -> u16 {
        self.0.frames_accepted()
    }

    /// The number of frames with a wrong checksum, 0 to 65535; wraps.
    #[getter]
    fn frames_corrupted(&self) -> u16 {
        self.0.frames_corrupted()
    }

    /// The number of refused frames, 0 to 65535; wraps.
    #[getter]
    fn frames_refused(&self) -> u16 {
        self.0.frames_refused()
    }

    /// The number of questions on the servo bus without an accepted answer, 0 to 65535; wraps.
    #[getter]
    fn servo_bus_errors(&self) -> u16 {
        self.0.servo_bus_errors()
    }

    /// Why the last refused frame was refused; `None` if none was.
    #[getter]
    fn last_refusal(&self) -> Option<&'static str> {
        self.0.last_refusal().map(|(reason, _)| refusal_reason(reason))
    }

    fn __repr__(&self) -> String {
        let (faults, missing) = (faults(self.0.faults()), joints(self.0.missing()));
        format!("<Status faults: {faults}; not answering: {missing}; moving: {}>", joints(self.0.moving()))
    }

    fn __str__(&self) -> String {
        self.rows().map(|(name, value)| format!("{name}: {value}")).join("\n")
    }

    fn _repr_html_(&self) -> String {
        html_table(&self.rows())
    }
}

/// The numbers of joints. A vector of bytes would be `bytes` in Python.
fn numbers(bits: u8) -> Vec<u16> {
    Joint::ALL.iter().filter(|joint| bits & joint.bit() != 0).map(|joint| joint.number().into()).collect()
}

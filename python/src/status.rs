//! `Status`: the health of an arm and its status block.

use std::hash::{DefaultHasher, Hash, Hasher};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sevenbot::health::JointHealth;
use sevenbot::joints::JointSnapshot;
use sevenbot::register_text::{faults, joints, motor_state_name, refusal_reason, servo_alarms};
use sevenbot::{Arm, Error, Health, Joint, Snapshot, StatusBlock};

use crate::errors::InvalidValue;
use crate::health::{JointStatus, Problem};
use crate::tip::html_table;

/// The health of the arm at one instant. Only this project's firmware has it. Two are equal if all registers of the arm were equal.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Status {
    block: StatusBlock,
    health: Health,
    /// Registers 0 to 255, from which the other fields are computed.
    registers: Vec<u8>,
}

impl Status {
    /// Reads the status of an arm; `None` if the firmware has no status block.
    pub(crate) fn read(arm: &mut Arm) -> Result<Option<Self>, Error> {
        let joints = arm.read_span(JointSnapshot::REGISTERS)?;
        let registers = arm.with_blocks(&joints)?;
        Ok(Self::of_registers(registers))
    }

    /// `None` if the firmware had no status block.
    fn of_registers(registers: Snapshot) -> Option<Self> {
        let (health, values) = (Health::new(&registers), registers.values.clone());
        health.faults?;
        Some(Self { block: StatusBlock::from(registers), health, registers: values })
    }
}

impl Status {
    fn rows(&self) -> [(&'static str, String); 8] {
        let unknown = || "unknown".to_owned();
        [
            ("faults", faults(self.block.faults())),
            ("not answering", joints(self.block.missing())),
            ("needs attention", {
                let problems = self.health.problems();
                if problems.is_empty() {
                    "nothing".to_owned()
                } else {
                    sevenbot::health::sentences(&problems)
                }
            }),
            ("moving", joints(self.block.moving())),
            ("supply", self.block.supply_volts().map_or_else(unknown, |volts| format!("{volts:.1} V"))),
            (
                "hottest servo",
                self.block.hottest_celsius().map_or_else(unknown, |degrees| format!("{degrees} °C")),
            ),
            ("frames accepted, corrupted, refused", {
                format!(
                    "{}, {}, {}",
                    self.block.frames_accepted(),
                    self.block.frames_corrupted(),
                    self.block.frames_refused()
                )
            }),
            ("last refusal", self.last_refusal().unwrap_or("none").to_owned()),
        ]
    }
}

#[pymethods]
impl Status {
    /// Does nothing need attention?
    #[getter]
    fn is_healthy(&self) -> bool {
        self.health.problems().is_empty()
    }

    /// What needs attention, the most important first; each has a `remedy`.
    #[getter]
    fn problems(&self) -> Vec<Problem> {
        self.health.problems().into_iter().map(Problem::from).collect()
    }

    /// The joints, joint 1 first.
    #[getter]
    fn joints(&self) -> Vec<JointStatus> {
        let is_driven = self.health.is_driven();
        let of = |joint: &JointHealth| JointStatus::of(*joint, is_driven, self.registers.clone());
        self.health.joints.iter().map(of).collect()
    }

    /// The motor state: `"servo"`, `"damping protection"` or `"forceless"`.
    #[getter]
    fn motor_state(&self) -> &'static str {
        motor_state_name(self.health.motor_state)
    }

    /// The joints, 1 to 7, that an obstacle keeps from their targets.
    #[getter]
    fn blocked(&self) -> Vec<u16> {
        self.numbers_of(|joint| joint.is_blocked)
    }

    /// The joints, 1 to 7, whose servo holds no torque although it should.
    #[getter]
    fn let_go(&self) -> Vec<u16> {
        self.numbers_of(|joint| joint.has_let_go)
    }

    /// The alarms of the servos as text, `"none"` without any; `None` if unknown.
    #[getter]
    fn alarms(&self) -> Option<String> {
        self.health.alarms.map(servo_alarms)
    }

    /// Did the controller switch the motors off because the servos lost their supply? `None` if unknown.
    #[getter]
    fn supply_lost(&self) -> Option<bool> {
        self.health.is_supply_lost
    }

    /// The faults as text; `"none"` without any.
    #[getter]
    fn faults(&self) -> String {
        faults(self.block.faults())
    }

    /// The bits of register 241.
    #[getter]
    fn fault_bits(&self) -> u8 {
        self.block.faults()
    }

    /// The joints, 1 to 7, whose servo does not answer.
    #[getter]
    fn missing(&self) -> Vec<u16> {
        numbers(self.block.missing())
    }

    /// The joints, 1 to 7, whose set-point moves.
    #[getter]
    fn moving(&self) -> Vec<u16> {
        numbers(self.block.moving())
    }

    /// The supply of the servos in volts; `None` if unknown.
    #[getter]
    fn supply_volts(&self) -> Option<f64> {
        self.block.supply_volts()
    }

    /// The temperature of the hottest servo in degrees Celsius; `None` if unknown.
    #[getter]
    fn hottest_celsius(&self) -> Option<u8> {
        self.block.hottest_celsius()
    }

    /// The number of accepted frames, 0 to 65535; wraps.
    #[getter]
    fn frames_accepted(&self) -> u16 {
        self.block.frames_accepted()
    }

    /// The number of frames with a wrong checksum, 0 to 65535; wraps.
    #[getter]
    fn frames_corrupted(&self) -> u16 {
        self.block.frames_corrupted()
    }

    /// The number of refused frames, 0 to 65535; wraps.
    #[getter]
    fn frames_refused(&self) -> u16 {
        self.block.frames_refused()
    }

    /// The number of questions on the servo bus without an accepted answer, 0 to 65535; wraps.
    #[getter]
    fn servo_bus_errors(&self) -> u16 {
        self.block.servo_bus_errors()
    }

    /// Why the last refused frame was refused; `None` if none was.
    #[getter]
    fn last_refusal(&self) -> Option<&'static str> {
        self.block.last_refusal().map(|(reason, _)| refusal_reason(reason))
    }

    /// From registers 0 to 255: what `pickle` calls.
    #[staticmethod]
    fn _of_registers(py: Python<'_>, registers: Vec<u8>) -> PyResult<Self> {
        let wrong = || InvalidValue::raise(py, "these are not the registers of a status");
        if registers.len() != 256 {
            return Err(wrong());
        }
        Self::of_registers(Snapshot { address: 0, values: registers }).ok_or_else(wrong)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.registers == other.registers
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.registers.hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let registers = PyBytes::new(py, &self.registers);
        Ok((py.get_type::<Self>().getattr("_of_registers")?, (registers,)))
    }

    fn __repr__(&self) -> String {
        let (faults, missing) = (faults(self.block.faults()), joints(self.block.missing()));
        format!(
            "<Status faults: {faults}; not answering: {missing}; moving: {}>",
            joints(self.block.moving())
        )
    }

    fn __str__(&self) -> String {
        self.rows().map(|(name, value)| format!("{name}: {value}")).join("\n")
    }

    fn _repr_html_(&self) -> String {
        html_table(&self.rows())
    }
}

impl Status {
    fn numbers_of(&self, is_so: fn(&JointHealth) -> Option<bool>) -> Vec<u16> {
        let joints = self.health.joints.iter().filter(|joint| is_so(joint) == Some(true));
        joints.map(|joint| u16::from(joint.joint.number())).collect()
    }
}

/// The numbers of the joints in `bits`. They are `u16`, because Python would get a vector of `u8` as `bytes`.
fn numbers(bits: u8) -> Vec<u16> {
    Joint::ALL.iter().filter(|joint| bits & joint.bit() != 0).map(|joint| u16::from(joint.number())).collect()
}

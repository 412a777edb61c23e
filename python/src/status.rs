//! `Status`: the health of an arm and its status block.

use pyo3::prelude::*;
use sevenbot::joints::JointSnapshot;
use sevenbot::register_text::{faults, joints, motor_state_name, refusal_reason, servo_alarms};
use sevenbot::{Arm, Error, Health, Joint, StatusBlock};

use crate::health::{JointStatus, Problem};
use crate::tip::html_table;

/// The health of the arm at one instant. Only this project's firmware tells it.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Status(StatusBlock, Health);

impl Status {
    /// Reads it from an arm; `None` if the firmware has no status block.
    pub(crate) fn read(arm: &mut Arm) -> Result<Option<Self>, Error> {
        let joints = arm.read_span(JointSnapshot::REGISTERS)?;
        let registers = arm.with_blocks(&joints)?;
        let health = Health::new(&registers);
        Ok(health.faults.is_some().then(|| Self(StatusBlock::from(registers), health)))
    }
}

impl Status {
    fn rows(&self) -> [(&'static str, String); 8] {
        let unknown = || "unknown".to_owned();
        [
            ("faults", faults(self.0.faults())),
            ("not answering", joints(self.0.missing())),
            ("needs attention", {
                let problems = self.1.problems();
                if problems.is_empty() {
                    "nothing".to_owned()
                } else {
                    sevenbot::health::sentences(&problems)
                }
            }),
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
    /// Does nothing need attention?
    #[getter]
    fn is_healthy(&self) -> bool {
        self.1.problems().is_empty()
    }

    /// What needs attention, the most important first; each has a `remedy`.
    #[getter]
    fn problems(&self) -> Vec<Problem> {
        self.1.problems().into_iter().map(Problem::from).collect()
    }

    /// The joints, joint 1 first.
    #[getter]
    fn joints(&self) -> Vec<JointStatus> {
        self.1.joints.iter().map(|joint| JointStatus::of(*joint, self.1.is_driven())).collect()
    }

    /// The motor state: `"servo"`, `"damping protection"` or `"forceless"`.
    #[getter]
    fn motor_state(&self) -> &'static str {
        motor_state_name(self.1.motor_state)
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
        self.1.alarms.map(servo_alarms)
    }

    /// Did the controller switch the motors off because the servos lost their supply? `None` if unknown.
    #[getter]
    fn supply_lost(&self) -> Option<bool> {
        self.1.is_supply_lost
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

impl Status {
    fn numbers_of(&self, is_so: fn(&sevenbot::health::JointHealth) -> Option<bool>) -> Vec<u16> {
        let joints = self.1.joints.iter().filter(|joint| is_so(joint) == Some(true));
        joints.map(|joint| joint.joint.number().into()).collect()
    }
}

/// The numbers of joints. A vector of bytes would be `bytes` in Python.
fn numbers(bits: u8) -> Vec<u16> {
    Joint::ALL.iter().filter(|joint| bits & joint.bit() != 0).map(|joint| joint.number().into()).collect()
}

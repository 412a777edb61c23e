//! A test's work bench: an arm of the right kind in a known state, and a line to it.

use std::any::type_name;
use std::env;
use std::fs::File;
use std::io::{self, Write};
use std::ops::{Deref, DerefMut};
use std::path::PathBuf;
use std::process::Output;
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use crate::line::{Line, PATIENCE};
use crate::own::{OwnArm, World};
use crate::programs::tool;
use crate::registers::{
    DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FEEDBACK_FREQUENCY, MOVING_JOINTS, PRESENT_POSITION,
    STANDARD_POSE, TARGET_POSITION,
};
use crate::target::{Need, Port, Target};

/// The baud rate of an arm that nobody has changed.
const BAUD: u32 = 115_200;
/// Settings that a test may change: device id, baud rate code, offsets.
const SETTINGS: u8 = 9;

/// Is a joint where it should be? Registers are whole degrees, and servos have some play.
#[must_use]
pub const fn near(is: u8, wanted: u8) -> bool {
    is.abs_diff(wanted) <= 2
}

/// What a test asks of its arm.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    needs: Vec<Need>,
    /// Names and values.
    options: Vec<(String, String)>,
    is_faulty: bool,
}

impl Setup {
    /// Any arm will do.
    #[must_use]
    pub fn any() -> Self {
        Self::default()
    }

    /// Only an arm that can do this will do.
    #[must_use]
    pub fn needs(mut self, need: Need) -> Self {
        self.needs.push(need);
        self
    }

    /// An arm whose chip has this number, twelve hexadecimal digits.
    #[must_use]
    pub fn chip_id(self, digits: &str) -> Self {
        self.needs(Need::ChosenChipId).option("--chip-id", digits)
    }

    /// An arm with a faulty servo, as `3=missing`.
    #[must_use]
    pub fn fault(mut self, fault: &str) -> Self {
        self.is_faulty = true;
        self.needs(Need::ServoFaults).option("--fault", fault)
    }

    /// An arm that stays where it is without torque: a stand or a hand supports it.
    #[must_use]
    pub fn supported(self) -> Self {
        self.needs(Need::Support).option("--fault", "arm=supported")
    }

    fn option(mut self, name: &str, value: &str) -> Self {
        self.options.push((name.to_owned(), value.to_owned()));
        self
    }
}

/// Runs a test against an arm that is up and at rest, or says why it cannot. With `ARM_MEETS_ALL_NEEDS` set that is a
/// failure: whoever chooses the tests has to leave this one out.
pub fn with_arm<T: FnOnce(&mut Bench)>(setup: Setup, test: T) {
    let shared = env::var_os("ARM_PORT").map(|path| Port(PathBuf::from(path)));
    let world = World::chosen();
    let lacks = |&need: &Need| shared.as_ref().map_or_else(|| world.lacks(need), |port| port.lacks(need));
    if let Some(reason) = setup.needs.iter().find_map(lacks) {
        let name = type_name::<T>().trim_end_matches("::{{closure}}");
        assert!(env::var_os("ARM_MEETS_ALL_NEEDS").is_none(), "`--skip {name}` is missing: {reason}");
        return skip(name, reason);
    }
    // One arm for all tests, in all threads and processes: one after another.
    let _turn = shared.as_ref().map(|_| turn());
    let target: Box<dyn Target> = match shared {
        Some(port) => Box::new(port),
        None => Box::new(OwnArm::start(world, setup.options)),
    };
    let is_fresh = target.lacks(Need::FreshArm).is_none();
    let line = Line::open(target.port(), BAUD);
    let mut bench = Bench { line: Some(line), target, settings: None };
    if !is_fresh {
        bench.bring_to_known_state();
    } else if !setup.is_faulty {
        // Servos need a while after power-up.
        bench.wait_for_pose(&STANDARD_POSE);
    }
    test(&mut bench);
}

/// Past the capture of the test runner, which keeps quiet about tests that pass.
fn skip(test: &str, reason: &str) {
    // In one piece: other tests write there too.
    let line = format!("skipped {test}: {reason}\n");
    let _ = io::stderr().write_all(line.as_bytes());
}

fn turn() -> File {
    let path = env::temp_dir().join("7bot-system-tests.lock");
    let file = File::create(path).expect("a lock file");
    file.lock().expect("the lock");
    file
}

/// An arm and a line to it. Whatever [`Line`] can do, it can.
pub struct Bench {
    line: Option<Line>,
    target: Box<dyn Target>,
    /// Of an arm that others use too: what has to be put back.
    settings: Option<Vec<u8>>,
}

impl Deref for Bench {
    type Target = Line;

    fn deref(&self) -> &Line {
        self.line.as_ref().expect("the line is open")
    }
}

impl DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut Line {
        self.line.as_mut().expect("the line is open")
    }
}

impl Bench {
    /// Can this arm meet a need?
    #[must_use]
    pub fn can(&self, need: Need) -> bool {
        self.target.lacks(need).is_none()
    }

    /// Switches the arm off and on, and waits until it answers again: at this baud rate, with a RAM that has
    /// forgotten everything.
    pub fn power_cycle(&mut self, baud: u32) {
        self.write(EFFECTOR_TYPE, &[1]);
        assert_eq!(self.register(EFFECTOR_TYPE), 1, "set before the power goes");
        self.target.power_cycle();
        self.reopen(baud);
        let patience = Duration::from_millis(500);
        self.wait_until("the arm is back with an empty RAM", |arm| {
            arm.try_read(EFFECTOR_TYPE, 1, patience) == Some(vec![0])
        });
        // Answers to what was asked while it was coming up.
        self.quieten();
    }

    /// Restarts the controller alone, and waits until it answers again with a RAM that has forgotten everything.
    pub fn restart_controller(&mut self) {
        self.write(EFFECTOR_TYPE, &[1]);
        assert_eq!(self.register(EFFECTOR_TYPE), 1, "set before the restart");
        self.target.restart_controller();
        let patience = Duration::from_millis(500);
        self.wait_until("the controller is back with an empty RAM", |arm| {
            arm.try_read(EFFECTOR_TYPE, 1, patience) == Some(vec![0])
        });
        self.quieten();
    }

    /// Kills the arm with no chance to tidy up, starts it again, and opens its port anew.
    pub fn kill_and_restart(&mut self) {
        self.line = None;
        self.target.restart_after_kill();
        self.reopen(BAUD);
    }

    /// Closes the port and opens it again.
    pub fn reopen(&mut self, baud: u32) {
        self.line = None;
        self.line = Some(Line::open(self.target.port(), baud));
    }

    /// Closes the port and says its name, for somebody else to open; [`Bench::reopen`] takes it back.
    pub fn lend_port(&mut self) -> PathBuf {
        self.line = None;
        self.target.port().to_owned()
    }

    /// Opens the EEPROM lock, writes, and closes it.
    pub fn write_setting(&mut self, address: u8, values: &[u8]) {
        self.write(EEPROM_LOCK, &[0]);
        self.write(address, values);
        self.write(EEPROM_LOCK, &[1]);
    }

    /// Waits for something to become true.
    #[track_caller]
    pub fn wait_until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        let deadline = Instant::now() + PATIENCE;
        while !is_so(self) {
            assert!(Instant::now() < deadline, "waited in vain until {what}");
            sleep(Duration::from_millis(10));
        }
    }

    /// Waits until no set-point is on its way.
    #[track_caller]
    pub fn wait_until_still(&mut self) {
        self.wait_until("all joints have arrived", |arm| arm.register(MOVING_JOINTS) == 0);
    }

    /// Sends the arm to a pose and waits until it is there. On a machine so busy that a servo misses its turns the arm
    /// takes the joint up again where it stands (D12): then it is told once more.
    #[track_caller]
    pub fn drive_to(&mut self, pose: &[u8; 7]) {
        self.write(TARGET_POSITION, pose);
        self.wait_until("the arm has gone to the pose", |arm| {
            if arm.read(TARGET_POSITION, 7) != pose {
                arm.write(TARGET_POSITION, pose);
            }
            arm.positions().iter().zip(pose).all(|(is, wanted)| near(*is, *wanted))
        });
        self.wait_until_still();
    }

    /// The measured positions.
    #[track_caller]
    pub fn positions(&mut self) -> Vec<u8> {
        self.read(PRESENT_POSITION, 7)
    }

    /// Waits until the measured positions are these, as near as a servo gets.
    #[track_caller]
    pub fn wait_for_pose(&mut self, pose: &[u8]) {
        self.wait_until("the arm stands in the pose", |arm| {
            arm.positions().iter().zip(pose).all(|(is, wanted)| near(*is, *wanted))
        });
    }

    /// Runs the command line tool on this arm's port, which nobody else may have open meanwhile.
    pub fn sevenbot(&mut self, arguments: &[&str]) -> Output {
        let port = self.lend_port();
        let output = tool().arg("--port").arg(port).args(arguments).output();
        self.reopen(BAUD);
        output.expect("sevenbot runs")
    }

    /// An arm that others used before: no reports, settings locked, motors on, default pace, at rest in the
    /// standard pose.
    fn bring_to_known_state(&mut self) {
        self.write(FEEDBACK_FREQUENCY, &[0]);
        self.quieten();
        let ram = [[1, 1, 0, 0].as_slice(), &[60; 7], &[0; 7], &STANDARD_POSE].concat();
        self.write(EEPROM_LOCK, &ram);
        self.wait_for_pose(&STANDARD_POSE);
        self.wait_until_still();
        self.settings = Some(self.read(DEVICE_ID, SETTINGS));
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        // After a failure the arm may not answer: nothing here may wait for it.
        if let (Some(settings), Some(line)) = (self.settings.take(), self.line.as_mut()) {
            line.write(FEEDBACK_FREQUENCY, &[0]);
            line.write(EEPROM_LOCK, &[0]);
            line.write(DEVICE_ID, &settings);
            line.write(EEPROM_LOCK, &[1]);
            // The port is closed next; what it has not sent by then may be lost.
            thread::sleep(Duration::from_millis(100));
        }
    }
}

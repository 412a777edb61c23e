//! The arm of a test: in a known state, with a client on its port.

use std::any::type_name;
use std::env;
use std::fs::File;
use std::io::{self, Read, Write};
use std::ops::{Deref, DerefMut};
use std::path::PathBuf;
use std::process::{Output, Stdio};
use std::thread::sleep;
use std::time::Duration;

use crate::arm_client::ArmClient;
use crate::arm_control::{ArmControl, ExternalArm, Need};
use crate::process::RunningProgram;
use crate::programs::tool;
use crate::registers::{
    DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FEEDBACK_FREQUENCY, MOVING_JOINTS, PRESENT_POSITION,
    STANDARD_POSE, TARGET_POSITION,
};
use crate::started_arm::{ArmKind, StartedArm};
use crate::wait;

/// The default baud rate.
const BAUD: u32 = 115_200;
/// The number of settings that are restored: device id, baud rate code, offsets.
const SETTINGS: u8 = 9;

/// True if positions differ by at most 2 degrees: registers hold whole degrees, and servos have some play.
#[must_use]
pub const fn near(actual: u8, expected: u8) -> bool {
    actual.abs_diff(expected) <= 2
}

/// Each joint is measured anew in this time.
const MEASURED_ANEW: Duration = Duration::from_millis(150);

/// What a test needs from its arm.
#[derive(Clone, Debug, Default)]
pub struct TestSetup {
    needs: Vec<Need>,
    /// Names and values.
    options: Vec<(String, String)>,
    is_faulty: bool,
}

impl TestSetup {
    /// Without needs: any arm will do.
    #[must_use]
    pub fn any() -> Self {
        Self::default()
    }

    /// Only an arm with this capability.
    #[must_use]
    pub fn needs(mut self, need: Need) -> Self {
        self.needs.push(need);
        self
    }

    /// An arm with this chip id, twelve hexadecimal digits.
    #[must_use]
    pub fn chip_id(self, digits: &str) -> Self {
        self.needs(Need::ChosenChipId).option("--chip-id", digits)
    }

    /// An arm with a servo fault, such as `3=missing`.
    #[must_use]
    pub fn fault(mut self, fault: &str) -> Self {
        self.is_faulty = true;
        self.needs(Need::ServoFaults).option("--fault", fault)
    }

    /// An arm that does not fall without torque, because a stand supports it.
    #[must_use]
    pub fn supported(self) -> Self {
        self.needs(Need::Support).option("--fault", "arm=supported")
    }

    fn option(mut self, name: &str, value: &str) -> Self {
        self.options.push((name.to_owned(), value.to_owned()));
        self
    }
}

/// Runs a test with an arm that has started. Without servo faults, the arm is in the standard pose. Skips the test if the arm
/// lacks a capability. With `ARM_MEETS_ALL_NEEDS` set, this is a failure instead.
pub fn with_arm<T: FnOnce(&mut TestArm)>(setup: TestSetup, test: T) {
    let shared = env::var_os("ARM_PORT").map(|path| ExternalArm(PathBuf::from(path)));
    let kind = ArmKind::chosen();
    let lacks = |&need: &Need| shared.as_ref().map_or_else(|| kind.lacks(need), |arm| arm.lacks(need));
    if let Some(reason) = setup.needs.iter().find_map(lacks) {
        let name = type_name::<T>().trim_end_matches("::{{closure}}");
        assert!(env::var_os("ARM_MEETS_ALL_NEEDS").is_none(), "`--skip {name}` is missing: {reason}");
        return skip(name, reason);
    }
    // Tests in all threads and processes share one arm, so they run in turn.
    let _lock = shared.as_ref().map(|_| lock_shared_arm());
    let control: Box<dyn ArmControl> = match shared {
        Some(arm) => Box::new(arm),
        None => Box::new(StartedArm::start(kind, setup.options)),
    };
    let is_fresh = control.lacks(Need::FreshArm).is_none();
    let client = ArmClient::open(control.port(), BAUD);
    let mut arm = TestArm { client: Some(client), control, settings: None };
    if !is_fresh {
        arm.reset_shared_arm();
    } else if !setup.is_faulty {
        // Servos take time to start.
        arm.wait_for_pose(&STANDARD_POSE);
    }
    test(&mut arm);
}

/// Reports a skipped test on standard error, past the output capture of the test runner.
fn skip(test: &str, reason: &str) {
    // One write, because other tests write there too.
    let line = format!("skipped {test}: {reason}\n");
    let _ = io::stderr().write_all(line.as_bytes());
}

fn lock_shared_arm() -> File {
    let path = env::temp_dir().join("7bot-system-tests.lock");
    let file = File::create(path).expect("a lock file");
    file.lock().expect("the lock");
    file
}

/// The arm of a test. It has all methods of [`ArmClient`].
pub struct TestArm {
    client: Option<ArmClient>,
    control: Box<dyn ArmControl>,
    /// The settings of a shared arm, to restore.
    settings: Option<Vec<u8>>,
}

impl Deref for TestArm {
    type Target = ArmClient;

    fn deref(&self) -> &ArmClient {
        self.client.as_ref().expect("the port is open")
    }
}

impl DerefMut for TestArm {
    fn deref_mut(&mut self) -> &mut ArmClient {
        self.client.as_mut().expect("the port is open")
    }
}

impl TestArm {
    /// True if this arm has a capability.
    #[must_use]
    pub fn has(&self, need: Need) -> bool {
        self.control.lacks(need).is_none()
    }

    /// Switches the arm off and on, opens its port at this baud rate, and waits until it has started.
    pub fn power_cycle(&mut self, baud: u32) {
        self.mark_ram();
        self.control.power_cycle();
        self.reopen(baud);
        self.wait_for_restart();
        // Drops the replies to reads during the start.
        self.drain();
    }

    /// Restarts the controller alone, and waits until it has started.
    pub fn restart_controller(&mut self) {
        self.mark_ram();
        self.control.restart_controller();
        self.wait_for_restart();
        self.drain();
    }

    /// Kills the arm, starts it again, and opens its port.
    pub fn kill_and_restart(&mut self) {
        self.client = None;
        self.control.restart_after_kill();
        self.reopen(BAUD);
    }

    /// Writes 1 to a RAM register. [`Self::wait_for_restart`] waits until the restart has reset it to 0.
    fn mark_ram(&mut self) {
        self.write(EFFECTOR_TYPE, &[1]);
        assert_eq!(self.register(EFFECTOR_TYPE), 1, "the mark before a restart");
    }

    fn wait_for_restart(&mut self) {
        let timeout = Duration::from_millis(500);
        self.wait_until("the arm has started again", |arm| {
            arm.try_read(EFFECTOR_TYPE, 1, timeout) == Some(vec![0])
        });
    }

    /// Closes the port and opens it again.
    pub fn reopen(&mut self, baud: u32) {
        self.client = None;
        self.client = Some(ArmClient::open(self.control.port(), baud));
    }

    /// Closes the port for another program, and returns its path. [`TestArm::reopen`] opens it again.
    pub fn lend_port(&mut self) -> PathBuf {
        self.client = None;
        self.control.port().to_owned()
    }

    /// Opens the EEPROM lock, writes, and closes it.
    pub fn write_setting(&mut self, address: u8, values: &[u8]) {
        self.write(EEPROM_LOCK, &[0]);
        self.write(address, values);
        self.write(EEPROM_LOCK, &[1]);
    }

    /// Polls until `holds` returns true. Panics with `condition` after [`wait::TIMEOUT`].
    #[track_caller]
    pub fn wait_until(&mut self, condition: &str, mut holds: impl FnMut(&mut Self) -> bool) {
        wait::wait_until(condition, || holds(self));
    }

    /// Waits until no set-point moves.
    #[track_caller]
    pub fn wait_until_still(&mut self) {
        self.wait_until("all joints have arrived", |arm| arm.register(MOVING_JOINTS) == 0);
    }

    /// Moves the arm to a pose, and waits until it is at rest there. On a busy machine a servo may be lost, and its joint then
    /// gets its position as the target (D12). So the targets are written again if they have changed.
    #[track_caller]
    pub fn drive_to(&mut self, pose: &[u8; 7]) {
        self.write(TARGET_POSITION, pose);
        self.wait_until("the arm has reached the pose", |arm| {
            if arm.read(TARGET_POSITION, 7) != pose {
                arm.write(TARGET_POSITION, pose);
            }
            arm.positions().iter().zip(pose).all(|(actual, expected)| near(*actual, *expected))
        });
        self.wait_until_still();
        // On a busy machine a servo behind an adapter is measured late, and still moves then.
        let mut last = Vec::new();
        self.wait_until("the arm is at rest", |arm| {
            sleep(MEASURED_ANEW);
            let before = std::mem::replace(&mut last, arm.positions());
            before == last
        });
    }

    /// The measured positions in degrees, joint 1 first.
    #[track_caller]
    pub fn positions(&mut self) -> Vec<u8> {
        self.read(PRESENT_POSITION, 7)
    }

    /// Waits until the measured positions are near these.
    #[track_caller]
    pub fn wait_for_pose(&mut self, pose: &[u8]) {
        self.wait_until("the arm is in the pose", |arm| {
            arm.positions().iter().zip(pose).all(|(actual, expected)| near(*actual, *expected))
        });
    }

    /// Starts the command line tool on the port of this arm, without standard input. After its end, call [`TestArm::reopen`].
    pub fn spawn_sevenbot(&mut self, arguments: &[&str]) -> RunningProgram {
        let mut tool = tool();
        tool.arg("--port").arg(self.lend_port()).args(arguments).stdin(Stdio::null());
        RunningProgram::spawn(tool.stdout(Stdio::piped()).stderr(Stdio::piped()))
    }

    /// As [`Self::spawn_sevenbot`], and waits until the tool prints `text` on standard error, such as a frame with
    /// `--verbose`.
    pub fn spawn_sevenbot_until(&mut self, arguments: &[&str], text: &str) -> RunningProgram {
        let mut tool = self.spawn_sevenbot(arguments);
        let mut stderr = tool.stderr.take().expect("a pipe");
        let mut received = Vec::new();
        while !String::from_utf8_lossy(&received).contains(text) {
            let mut chunk = [0; 256];
            let length = stderr.read(&mut chunk).expect("text");
            assert_ne!(length, 0, "ended without {text}:\n{}", String::from_utf8_lossy(&received));
            received.extend(&chunk[..length]);
        }
        tool.stderr = Some(stderr);
        tool
    }

    /// Runs the command line tool on the port of this arm to its end. Then opens the port again at the default baud rate.
    pub fn sevenbot(&mut self, arguments: &[&str]) -> Output {
        let port = self.lend_port();
        let output = tool().arg("--port").arg(port).args(arguments).output();
        self.reopen(BAUD);
        output.expect("sevenbot runs")
    }

    /// Writes the defaults of registers 28 to 53 to a shared arm, waits until the arm rests in the standard pose, and saves its
    /// settings.
    fn reset_shared_arm(&mut self) {
        self.write(FEEDBACK_FREQUENCY, &[0]);
        self.drain();
        let ram = [[1, 1, 0, 0].as_slice(), &[60; 7], &[0; 7], &STANDARD_POSE].concat();
        self.write(EEPROM_LOCK, &ram);
        self.wait_for_pose(&STANDARD_POSE);
        self.wait_until_still();
        self.settings = Some(self.read(DEVICE_ID, SETTINGS));
    }
}

impl Drop for TestArm {
    fn drop(&mut self) {
        // After a failure the arm may not reply, so nothing here waits for a reply.
        if let (Some(settings), Some(client)) = (self.settings.take(), self.client.as_mut()) {
            client.write(FEEDBACK_FREQUENCY, &[0]);
            client.write(EEPROM_LOCK, &[0]);
            client.write(DEVICE_ID, &settings);
            client.write(EEPROM_LOCK, &[1]);
            // The port closes next, which may drop bytes that are not sent yet.
            sleep(Duration::from_millis(100));
        }
    }
}

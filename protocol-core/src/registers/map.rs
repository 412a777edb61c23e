//! THE TABLE: every register of map 2.2 of the 7Bot V2 (docs/protocol.md).
//!
//! In the Rust code, outside tests, benchmarks and texts for users, only this table and the table of map 2.1 hold the arm's
//! register addresses as numbers. The registers of a server are in `host-link/src/sharing.rs`.

use super::range::Range;
use super::spec::{Register, eeprom, ram, rom, well_formed};
use super::unit::Unit;

/// Turns rows into named constants with their doc comments, and into [`MAP`] in the same order.
macro_rules! register_map {
    ($($(#[doc = $doc:literal])+ $name:ident = $row:expr;)+) => {
        $($(#[doc = $doc])+ pub const $name: Register = $row.described(stringify!($name), &[$($doc),+]);)+

        /// The whole table, in ascending order of address.
        pub const MAP: &[Register] = &[$($name),+];
    };
}

register_map! {
    /// Identifies a 7Bot V2 on a serial port.
    DEVICE_CODE = rom(0).default(7);
    /// Version of the firmware. The maker's are 1.0, 2.1 and 2.2; this project begins at 3.0 (D7).
    FIRMWARE_VERSION = rom(1).default(30).unit(Unit::VersionTenths);
    /// Unique number of the chip, most significant byte first (D8).
    CHIP_ID = rom(2).run(6);
    /// Reserved by the maker.
    RESERVED_8 = eeprom(8).run(3).reserved();
    /// The user's number for this arm.
    DEVICE_ID = eeprom(11);
    /// Code of the host link's baud rate: 115200, 250000, 500000, 1000000, 57600, 38400, 19200, 9600.
    /// Takes effect at the next restart.
    BAUD_RATE = eeprom(12).up_to(7);
    /// Assembly error of the joint: present angle = servo angle + offset (D9). -10 to 10 is a good assembly.
    OFFSET = eeprom(13).each_joint().plus_minus(16).unit(Unit::Degree);
    /// Reserved by the maker.
    RESERVED_20 = eeprom(20).run(8).reserved();
    /// 0: EEPROM registers are writable. 1: they are protected.
    EEPROM_LOCK = ram(28).up_to(1).default(1);
    /// 0: damping protection. 1: servo, the joints are driven. 2: forceless, the arm can be moved by hand (D13).
    MOTOR_STATE = ram(29).up_to(2).default(1);
    /// 0: suction cup. 1: gripper.
    EFFECTOR_TYPE = ram(30).up_to(1);
    /// 0: release. 1: suck (D20).
    VACUUM_PUMP = ram(31).up_to(1);
    /// Speed of the joint's moves; 0 is the motor's maximum, 372 °/s (D10, D11).
    SPEED = ram(32).each_joint().up_to(100).default(60).unit(Unit::SpeedStep);
    /// Duration of the joint's moves; used only while the joint's speed is 0 (D11).
    TIME = ram(39).each_joint().up_to(100).unit(Unit::Decisecond);
    /// Target of the joint. A write starts a move. Set to the measured position at start-up (D12).
    TARGET_POSITION =
        ram(46).each_joint().up_to(180).default_each([90, 90, 65, 90, 90, 90, 80]).unit(Unit::Degree);
    /// Rate of the reports of present positions; 0: no reports. Limited by the baud rate (D14).
    FEEDBACK_FREQUENCY = ram(53).up_to(50).unit(Unit::Hertz);
    /// Measured position of the joint.
    PRESENT_POSITION = ram(54).each_joint().up_to(180).read_only().unit(Unit::Degree);
    /// The target of the joint in hundredths of a degree: the same target as in 46 to 52. With a set-point period, each
    /// write is the next point of a stream (D21, D23).
    FINE_TARGET = ram(128)
        .word(Range::WordUpTo(18_000))
        .each_joint()
        .default_each([9_000, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000])
        .unit(Unit::Centidegree);
    /// Measured position of the joint; 65535 until it was measured (D21).
    FINE_POSITION = ram(142)
        .word(Range::WordUpTo(u16::MAX))
        .each_joint()
        .read_only()
        .default(u16::MAX)
        .unit(Unit::Centidegree);
    /// Velocity of the joint, as its servo measures it; positive towards greater angles (D21).
    VELOCITY =
        ram(156).word(Range::SignedWord).each_joint().read_only().unit(Unit::DecidegreePerSecond);
    /// Load of the joint, as its servo measures it; positive if the motor pushes towards greater angles (D21).
    LOAD = ram(170).word(Range::SignedWord).each_joint().read_only().unit(Unit::PermilleOfStall);
    /// Time between the points of a stream of fine targets, 5 to 1000; 0: fine targets are no stream (D23).
    SET_POINT_PERIOD = ram(184).word(Range::ZeroOr(5, 1_000)).unit(Unit::Millisecond);
    /// Longest silence of the host before the watchdog acts; 0: off (D24).
    HOST_WATCHDOG = ram(186).unit(Unit::Centisecond);
    /// What the watchdog of the host does. 0: the joints hold. 1: damping protection (D24).
    WATCHDOG_ACTION = ram(187).up_to(1);
    /// Bits: 0 the linkage of joints 2 and 3 is protected, 1 the claw is protected (D25).
    LIMITS = ram(188).up_to(3);
    /// What a report holds. 0: 54 to 60. 1: 142 to 155. 2: 142 to 183 (D26).
    REPORT_CONTENT = ram(189).up_to(2);
    /// Joints that were measured since power-up: bit n-1 is joint n.
    MEASURED_JOINTS = ram(190).read_only();
    /// Layout version of the extended block, this project's addition.
    EXTENDED_VERSION = ram(191).read_only().default(1);
    /// 1: a joint that pushes harder than its limit gives way, and a servo that let go engages anew. 0: neither does (D27,
    /// D28).
    PROTECTION = ram(192).up_to(1).default(1);
    /// How hard a joint may push; joint 7 too while the effector is a suction cup (D27).
    PUSH_LIMIT = ram(193).between(20, 100).default(70).unit(Unit::PercentOfStall);
    /// How hard joint 7 may push while the effector is a gripper (D27).
    GRIP_LIMIT = ram(194).between(10, 100).default(40).unit(Unit::PercentOfStall);
    /// Joints that an obstacle keeps from their targets: bit n-1 is joint n (D27).
    BLOCKED_JOINTS = ram(195).read_only();
    /// Joints whose servo holds no torque although it should: bit n-1 is joint n (D28).
    LET_GO_JOINTS = ram(196).read_only();
    /// Error bits of the servos' last answers, of all together: 0 voltage, 2 heat, 5 overload (D28).
    SERVO_ALARMS = ram(197).read_only();
    /// 1: the supply of the servos was lost, so the motor state is 0 until register 29 is written (D29).
    SUPPLY_LOST = ram(198).read_only();
    /// Layout version of the protection block, this project's addition.
    PROTECTION_VERSION = ram(199).read_only().default(1);
    /// Layout version of the status block, this project's addition.
    STATUS_VERSION = ram(240).read_only().default(1);
    /// Bits: 0 settings storage, 1 servo bus, 2 watchdog restart, 3 brown-out restart, 4 crystal failed,
    /// 5 over-run of the receive buffer, 6 the watchdog of the host acted (D24).
    FAULTS = ram(241).read_only();
    /// Servos that do not answer: bit n-1 is joint n.
    MISSING_SERVOS = ram(242).read_only();
    /// Joints whose set-point has not reached the target yet: bit n-1 is joint n.
    MOVING_JOINTS = ram(243).read_only();
    /// Why the last refused frame was refused: 0 none yet, 1 malformed range, 2 value out of range,
    /// 3 settings storage full, 4 half of a two-byte register (D22), 5 against a limit (D25), 6 no joint angles reach the
    /// position (M7).
    LAST_REFUSAL = ram(244).read_only();
    /// The register that caused the last refusal.
    LAST_REFUSED_REGISTER = ram(245).read_only();
    /// Frames accepted: low byte, high byte, wrapping.
    FRAMES_ACCEPTED = ram(246).run(2).read_only();
    /// Frames with a wrong CRC: low byte, high byte, wrapping.
    FRAMES_CORRUPTED = ram(248).run(2).read_only();
    /// Frames refused: low byte, high byte, wrapping.
    FRAMES_REFUSED = ram(250).run(2).read_only();
    /// Questions to servos without an answer, or with a damaged one, since start-up: low byte, high byte, wrapping.
    SERVO_BUS_ERRORS = ram(252).run(2).read_only();
    /// Supply voltage of the servos; 0: unknown.
    SUPPLY_VOLTAGE = ram(254).read_only().unit(Unit::Decivolt);
    /// Highest servo temperature; 0: unknown.
    SERVO_TEMPERATURE = ram(255).read_only().unit(Unit::Celsius);
}

const _: () = assert!(well_formed(MAP), "the register table has an overlap, a wrong order or a bad default");

/// The row that holds `address`; `None` if the table has no such row.
#[must_use]
pub fn find(address: u8) -> Option<&'static Register> {
    MAP.iter().find(|row| row.holds(address))
}

/// The bits of [`FAULTS`].
pub mod fault {
    /// Settings cannot be stored, or not before the next restart ([D19](crate::decisions#d19)).
    pub const SETTINGS_STORAGE: u8 = 1 << 0;
    /// A servo is missing or reports an error.
    pub const SERVO_BUS: u8 = 1 << 1;
    /// The watchdog caused the last restart.
    pub const WATCHDOG_RESTART: u8 = 1 << 2;
    /// A drop of the supply voltage caused the last restart.
    pub const BROWN_OUT_RESTART: u8 = 1 << 3;
    /// The crystal failed; the chip runs on its internal oscillator: 1 % off at 25 degrees Celsius, 4 % from -10 to 85.
    /// A serial line tolerates about 3.5 % between its two ends, so the host link works at room temperature at best.
    pub const CRYSTAL_FAILED: u8 = 1 << 4;
    /// Bytes from the host were lost, because the receive buffer was full.
    pub const RECEIVE_OVERRUN: u8 = 1 << 5;
    /// The watchdog of the host acted, and register 186 was not written since ([D24](crate::decisions#d24)).
    pub const HOST_SILENT: u8 = 1 << 6;
}

/// The bits of [`SERVO_ALARMS`], and of the error byte in a servo's answers.
pub mod servo_alarm {
    /// The supply is too low or too high.
    pub const VOLTAGE: u8 = 1 << 0;
    /// The motor is too hot. A joint that was let go for it engages only after its servo cooled down by 5 degrees Celsius
    /// ([D28](crate::decisions#d28)).
    pub const OVERHEAT: u8 = 1 << 2;
    /// The motor was overloaded for too long. The bit stays until torque is switched off.
    pub const OVERLOAD: u8 = 1 << 5;
}

/// The reasons of [`LAST_REFUSAL`].
pub mod refusal {
    /// Nothing was refused yet.
    pub const NONE: u8 = 0;
    /// The frame reached past address 255 ([D2](crate::decisions#d2)).
    pub const MALFORMED_RANGE: u8 = 1;
    /// A value was outside its register's range ([D16](crate::decisions#d16)).
    pub const OUT_OF_RANGE: u8 = 2;
    /// The settings storage is full until the next restart ([D19](crate::decisions#d19)).
    pub const STORAGE_FULL: u8 = 3;
    /// The frame would write one byte of a two-byte register ([D22](crate::decisions#d22)).
    pub const HALF_A_WORD: u8 = 4;
    /// A target, or a set-point, is against a limit that is switched on ([D25](crate::decisions#d25)).
    pub const AGAINST_A_LIMIT: u8 = 5;
    /// No joint angles reach the position in a write of map 2.1 ([M7](crate::decisions#m7)).
    pub const OUT_OF_REACH: u8 = 6;
}

/// The states of [`MOTOR_STATE`].
pub mod motor_state {
    /// The joints are damped, not driven.
    pub const DAMPING: u8 = 0;
    /// The joints are driven to their targets.
    pub const SERVO: u8 = 1;
    /// The joints are neither driven nor damped: the arm can be moved by hand.
    pub const FORCELESS: u8 = 2;
}

/// The values of [`EFFECTOR_TYPE`].
pub mod effector {
    /// A suction cup: joint 7 has the push limit of the other joints.
    pub const SUCTION_CUP: u8 = 0;
    /// A gripper: joint 7 is its claw.
    pub const GRIPPER: u8 = 1;
}

/// The bits of [`LIMITS`].
pub mod limit {
    /// The limit of the linkage of joints 2 and 3.
    pub const LINKAGE: u8 = 1 << 0;
    /// The smallest and the largest sum of the angles of joints 2 and 3, in degrees: the linkage allows 19 to 161 degrees for
    /// joint 3 - 65 degrees + joint 2 ([D25](crate::decisions#d25)).
    pub const LINKAGE_SUM: (u8, u8) = (84, 226);
    /// The limit of the claw, joint 7.
    pub const CLAW: u8 = 1 << 1;
    /// The largest angle of joint 7, in whole degrees: its servo ends at 1023 counts, which are 84.4 degrees.
    pub const CLAW_MAX: u8 = 84;
}

/// The values of [`REPORT_CONTENT`].
pub mod report_content {
    /// The present positions in degrees.
    pub const POSITIONS: u8 = 0;
    /// The present positions in hundredths of a degree.
    pub const FINE_POSITIONS: u8 = 1;
    /// The present positions in hundredths of a degree, velocities and loads.
    pub const FINE_STATE: u8 = 2;
}

/// The baud rates for the codes of [`BAUD_RATE`], in baud.
pub const BAUD_RATES: [u32; 8] = [115_200, 250_000, 500_000, 1_000_000, 57_600, 38_400, 19_200, 9_600];

/// The baud rate for a code. An unknown code counts as the default, so that no stored byte can lock a user out
/// ([D19](crate::decisions#d19)).
#[must_use]
pub fn baud_rate(code: u8) -> u32 {
    BAUD_RATES.get(usize::from(code)).copied().unwrap_or(115_200)
}

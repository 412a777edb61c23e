//! The accesses of the image to the chip's registers before its loop begins. The chip and the board demand the checked rules
//! (RM0090, ES0182, DS8626). An image that violates them still runs in the emulator.
//!
//! The emulator has no GPIO, clock tree, watchdog, supply monitor or flash controller. It logs the accesses to them, and reads
//! return 0.

use std::fs;

use emulator::chip_program::IMAGE;
use emulator::process::{ChildProcess, TaskResult, wait_for};
use emulator::{need_qemu, qemu};

/// An access to a register that the emulator lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RegisterAccess<'a> {
    /// Device and offset.
    Read(&'a str, u32),
    /// Device, offset and value; 0 if the log does not contain the value.
    Write(&'a str, u32, u32),
}
use RegisterAccess::{Read, Write};

/// The emulator's names of the independent watchdog, the debug unit and the flash controller.
const WATCHDOG: &str = "I2S2ext";
const PRIVATE: &str = "PPB";
const FLASH: &str = "Flash Int";

/// Offsets (RM0090, sections 7.3, 8.4, 5.4, 3.9, 21.4, 38.16).
const CLOCK_ENABLES: [u32; 3] = [0x30, 0x40, 0x44];
const MODE: u32 = 0x00;
const PULL: u32 = 0x0C;
const SET_RESET: u32 = 0x18;
const DEBUG_CONTROL: u32 = 0x4_2004;
const CLOCK_CONTROL: u32 = 0x00;

/// Pump and valve, PC6 and PC7: first driven low, then made outputs.
const PUMP_AND_VALVE_OFF: [RegisterAccess<'_>; 4] = [
    Write("GPIOC", SET_RESET, 1 << 22),
    Write("GPIOC", MODE, 1 << 12),
    Write("GPIOC", SET_RESET, 1 << 23),
    Write("GPIOC", MODE, 1 << 14),
];
/// PA1, the direction of a buffered servo bus: first driven low, then made an output.
const LISTENING: [RegisterAccess<'_>; 2] = [Write("GPIOA", SET_RESET, 1 << 17), Write("GPIOA", MODE, 1 << 2)];
/// PA10 becomes the input of the host link, which ends the start.
const HOST_LINK_OPEN: RegisterAccess<'_> = Write("GPIOA", MODE, 2 << 20);
/// Start, unlock, divisor, reload value, wait for both, feed.
const WATCHDOG_STARTED: [RegisterAccess<'_>; 6] = [
    Write(WATCHDOG, 0x00, 0xCCCC),
    Write(WATCHDOG, 0x00, 0x5555),
    Write(WATCHDOG, 0x04, 4),
    Write(WATCHDOG, 0x08, 1_000),
    Read(WATCHDOG, 0x0C),
    Write(WATCHDOG, 0x00, 0xAAAA),
];
/// The supply monitor is enabled at level 6.
const SUPPLY_WATCHED: RegisterAccess<'_> = Write("PWR", 0x00, 6 << 5 | 1 << 4);
/// An erase starts. The data cache is reset after it.
const ERASE: u32 = 1 << 16;
const CACHE_RESET: RegisterAccess<'_> = Write(FLASH, 0x00, 1 << 12);

#[test]
#[ignore = "it needs the emulator and the built image: `cargo xtask start-up`"]
fn the_image_follows_the_rules_of_the_chip() -> TaskResult {
    need_qemu()?;
    let log = log_of_start()?;
    let accesses: Vec<_> = log.lines().filter_map(access).collect();
    for (rule, holds) in RULES {
        assert!(holds(&accesses), "the start of the image violates a rule: {rule}");
        println!("{rule}");
    }
    Ok(())
}

/// A rule and its check.
type StartUpRule = (&'static str, fn(&[RegisterAccess<'_>]) -> bool);

const RULES: &[StartUpRule] = &[
    ("pump and valve are off before any other access except to their clock", |accesses| {
        let writes = accesses.iter().filter(|access| is_write(access)).skip(1);
        writes.take(PUMP_AND_VALVE_OFF.len()).eq(&PUMP_AND_VALVE_OFF)
    }),
    ("a debugger can attach to the sleeping core before the clock is started", |accesses| {
        let debug = position(accesses, Write(PRIVATE, DEBUG_CONTROL, 0));
        let clock = position(accesses, Read("RCC", CLOCK_CONTROL));
        debug.zip(clock).is_some_and(|(debug, clock)| debug < clock)
    }),
    ("each clock enable is read back at once", |accesses| {
        let is_enable =
            |access: &RegisterAccess<'_>| matches!(access, Write("RCC", at, _) if CLOCK_ENABLES.contains(at));
        let read_back = |pair: &[RegisterAccess<'_>]| match pair {
            [enable @ Write(_, at, _), next] if is_enable(enable) => *next == Read("RCC", *at),
            _ => true,
        };
        accesses.iter().filter(|access| is_enable(access)).count() >= CLOCK_ENABLES.len()
            && accesses.windows(2).all(read_back)
    }),
    ("the servo line has no pull inside the chip", |accesses| {
        let pulls = |access: &RegisterAccess<'_>| matches!(access, Write("GPIOA", PULL, value) if value >> 4 & 3 != 0);
        accesses.contains(&Write("GPIOA", PULL, 0)) && !accesses.iter().any(pulls)
    }),
    ("the direction of a buffered servo bus listens before its pin becomes an output", |accesses| {
        let writes: Vec<_> = accesses.iter().copied().filter(|access| is_write(access)).collect();
        writes.windows(2).any(|pair| pair == LISTENING)
    }),
    ("the watchdog is fed once its registers have taken their values", |accesses| {
        accesses.iter().filter(|access| is_at(access, WATCHDOG)).take(6).eq(&WATCHDOG_STARTED)
    }),
    ("the supply is monitored at level 6 before any access to the flash", |accesses| {
        let watched = position(accesses, SUPPLY_WATCHED);
        let touched = accesses.iter().position(|access| is_write(access) && is_at(access, FLASH));
        watched.zip(touched).is_some_and(|(watched, touched)| watched < touched)
    }),
    ("the data cache is reset after an erase", |accesses| {
        let is_erase =
            |access: &RegisterAccess<'_>| matches!(access, Write(FLASH, 0x10, value) if value & ERASE != 0);
        let erase = accesses.iter().rposition(is_erase);
        let reset = accesses.iter().rposition(|access| *access == CACHE_RESET);
        erase.zip(reset).is_some_and(|(erase, reset)| erase < reset)
    }),
];

fn is_write(access: &RegisterAccess<'_>) -> bool {
    matches!(access, Write(..))
}

fn is_at(access: &RegisterAccess<'_>, device: &str) -> bool {
    let (Read(at, _) | Write(at, ..)) = access;
    *at == device
}

fn position(accesses: &[RegisterAccess<'_>], expected: RegisterAccess<'_>) -> Option<usize> {
    accesses.iter().position(|access| *access == expected)
}

/// The log of the emulator until the host link is open.
fn log_of_start() -> TaskResult<String> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("log");
    let machine = qemu(&IMAGE)
        .args(["-serial", "null", "-serial", "null", "-d", "unimp,guest_errors", "-D"])
        .arg(&path)
        .spawn()?;
    let _machine = ChildProcess(machine);
    wait_for("the image opens its host link", || {
        let log = fs::read_to_string(&path).unwrap_or_default();
        // The last line of the log may be incomplete.
        let whole = log.rsplit_once('\n').map_or("", |(lines, _)| lines);
        let is_open = whole.lines().filter_map(access).any(|access| access == HOST_LINK_OPEN);
        Ok(is_open.then(|| whole.to_owned()))
    })
}

/// Parses a line of the log: `GPIOC: unimplemented device write (size 4, offset 0x018, value 0x00400000)`, or `Write of
/// unassigned area of PPB: offset 0x42004`.
fn access(line: &str) -> Option<RegisterAccess<'_>> {
    if let Some((kind, offset)) = line.split_once(" of unassigned area of PPB: offset 0x") {
        let offset = number(offset)?;
        return Some(if kind == "Read" { Read(PRIVATE, offset) } else { Write(PRIVATE, offset, 0) });
    }
    let (device, what) = line.split_once(": unimplemented device ")?;
    let (_, words) = what.split_once("offset 0x")?;
    match words.trim_end_matches(')').split_once(", value 0x") {
        Some((offset, value)) => Some(Write(device, number(offset)?, number(value)?)),
        None => Some(Read(device, number(words.trim_end_matches(')'))?)),
    }
}

fn number(digits: &str) -> Option<u32> {
    u32::from_str_radix(digits.trim(), 16).ok()
}

#[test]
fn lines_of_the_log_are_parsed() {
    for (line, expected) in [
        ("RCC: unimplemented device read  (size 4, offset 0x030)", Some(Read("RCC", 0x30))),
        (
            "GPIOC: unimplemented device write (size 4, offset 0x018, value 0x00400000)",
            Some(Write("GPIOC", 0x18, 0x40_0000)),
        ),
        ("Write of unassigned area of PPB: offset 0x42004", Some(Write(PRIVATE, 0x4_2004, 0))),
        ("Read of unassigned area of PPB: offset 0x42000", Some(Read(PRIVATE, 0x4_2000))),
        ("qemu-system-arm: terminating on signal 15", None),
    ] {
        assert_eq!(access(line), expected, "{line}");
    }
}

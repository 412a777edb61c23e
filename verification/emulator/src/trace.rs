//! Parses the emulator's log of executed instructions (`-singlestep`, `log exec`) and of accesses to peripherals.
//!
//! ```text
//!   Trace 0: 0x7f81a8 [00800409/0800c096/00000010/ff020201] USART1    about to execute; bit 0 of 00800409: in a handler
//!   Stopped execution of TB chain before 0x7f81a8 [0800c096] USART1   it was not executed after all
//!   cpu_io_recompile: rewound execution of TB to 0800c0c4             not executed either
//!   memory_region_ops_read cpu 0 mr 0x55 addr 0x40011000 value ...    a read of a peripheral
//! ```

use std::collections::HashMap;
use std::ops::Range;

use linked_image::Effect;

/// TIM2_CNT (RM0090, section 18.4).
const TIME: u64 = 0x4000_0024;
/// GPIOA_BSRR (RM0090, section 8.4.7).
const PORT_A: u64 = 0x4002_0018;

/// What a line of the log tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceEvent {
    /// An instruction was executed.
    Step {
        /// Its address.
        at: u64,
        /// True in an exception handler: bit 0 of the flags in the line.
        in_handler: bool,
    },
    /// The time was read: the count of TIM2, in microseconds.
    Time(u64),
    /// Pins of port A were set or cleared: the bits of GPIOA_BSRR.
    SwitchedPortA(u64),
    /// Another register of a peripheral was read.
    Read(u64),
    /// Another register of a peripheral was written.
    Wrote(u64),
}

/// The events of a log, in order, without instructions that were not executed after all.
pub fn parse(log: &str) -> Vec<TraceEvent> {
    let mut events = Vec::new();
    for line in log.lines() {
        if line.starts_with("Stopped ") || line.starts_with("cpu_io_recompile") {
            if let Some(TraceEvent::Step { .. }) = events.last() {
                events.pop();
            }
        } else {
            events.extend(event(line));
        }
    }
    events
}

fn event(line: &str) -> Option<TraceEvent> {
    if line.starts_with("Trace ") {
        let mut fields = line.split_once('[')?.1.split('/');
        let flags = hexadecimal(fields.next()?)?;
        return Some(TraceEvent::Step { at: hexadecimal(fields.next()?)?, in_handler: flags & 1 == 1 });
    }
    let access = line.strip_prefix("memory_region_ops_")?;
    let (address, rest) = access.split_once("addr 0x")?.1.split_once(" value 0x")?;
    let address = hexadecimal(address)?;
    let value = || hexadecimal(rest.split(' ').next()?);
    Some(match (access.starts_with("read"), address) {
        (true, TIME) => TraceEvent::Time(value()?),
        (false, PORT_A) => TraceEvent::SwitchedPortA(value()?),
        (true, _) => TraceEvent::Read(address),
        (false, _) => TraceEvent::Wrote(address),
    })
}

fn hexadecimal(digits: &str) -> Option<u64> {
    u64::from_str_radix(digits, 16).ok()
}

/// The number of executed instructions.
pub fn steps(events: &[TraceEvent]) -> u64 {
    events.iter().filter(|event| matches!(event, TraceEvent::Step { .. })).count() as u64
}

/// True if `event` is the execution of the instruction at `address`.
pub fn is_step_at(event: &TraceEvent, address: u64) -> bool {
    matches!(event, TraceEvent::Step { at, .. } if *at == address)
}

/// The number of events that are equal to `access`.
pub fn times(events: &[TraceEvent], access: TraceEvent) -> usize {
    events.iter().filter(|event| **event == access).count()
}

/// The ranges of events that begin with a mark and end before the next mark. The events after the last mark are left out.
pub fn between(events: &[TraceEvent], is_mark: impl Fn(&TraceEvent) -> bool) -> Vec<Range<usize>> {
    let marks: Vec<_> =
        events.iter().enumerate().filter(|(_, event)| is_mark(event)).map(|(at, _)| at).collect();
    marks.iter().zip(marks.iter().skip(1)).map(|(&from, &to)| from..to).collect()
}

/// The calls of the handler at `entry`, from its first instruction to its return. Leaves out calls that a handler of `entries`
/// interrupts, and a call whose return is not in `events`.
pub fn handler_calls<'a>(
    events: &'a [TraceEvent],
    entry: u64,
    entries: &[u64],
    effects: &HashMap<u64, Effect>,
) -> Vec<&'a [TraceEvent]> {
    let starts = events.iter().enumerate().filter(|(_, event)| is_step_at(event, entry));
    let calls = starts.filter_map(|(start, _)| call(events.get(start..)?, effects));
    let is_entry = |event: &TraceEvent| entries.iter().any(|&entry| is_step_at(event, entry));
    calls.filter(|call| !call.iter().skip(1).any(is_entry)).collect()
}

/// The events from the first instruction of a function to its return, with the functions that it calls; `None` if
/// `events` end before it returns.
fn call<'a>(events: &'a [TraceEvent], effects: &HashMap<u64, Effect>) -> Option<&'a [TraceEvent]> {
    let mut depth = 0_u32;
    let end = events.iter().position(|event| {
        let TraceEvent::Step { at, .. } = event else { return false };
        match effects.get(at) {
            Some(Effect::Call(_)) => depth += 1,
            Some(Effect::Return) if depth == 0 => return true,
            Some(Effect::Return) => depth -= 1,
            _ => {}
        }
        false
    });
    events.get(..=end?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "\
Trace 0: 0x7f81a810adc0 [00800408/0800e7a2/00000010/ff020201] _ZN14firmware_stm325Shell3run17he24a45144e4acff1E
Trace 0: 0x7f81a811b100 [00800409/0800c096/00000010/ff020201] USART1
Trace 0: 0x7f81a811c740 [00800409/0800c0c4/00000010/ff020201] USART1
cpu_io_recompile: rewound execution of TB to 0800c0c4
Trace 0: 0x7f81a811c8c0 [00800409/0800c0c4/00000010/ff038201] USART1
memory_region_ops_read cpu 0 mr 0x55a02f5b2aa0 addr 0x40011000 value 0xe0 size 2 name 'stm32f2xx-usart'
Trace 0: 0x7f81a811ca40 [00800409/0800c0c6/00000010/ff020201] USART1
Stopped execution of TB chain before 0x7f81a811ca40 [0800c0c6] USART1
Trace 0: 0x7f81a811ca40 [00800409/0800c0c6/00000010/ff020201] USART1
Trace 0: 0x7f81a810adc0 [00800408/0800e7a4/00000010/ff020201] _ZN14firmware_stm325Shell3run17he24a45144e4acff1E
";

    #[test]
    fn announced_instructions_count_only_if_executed() {
        let events = parse(LOG);
        assert_eq!(steps(&events), 5);
        assert_eq!(times(&events, TraceEvent::Read(0x4001_1000)), 1);
    }

    #[test]
    fn the_time_is_read_with_its_value() {
        let line = "memory_region_ops_read cpu 0 mr 0x55a0 addr 0x40000024 value 0x1f40 size 4 name 'stm32f2xx_timer'\n";
        assert_eq!(parse(line), [TraceEvent::Time(8_000)]);
    }

    #[test]
    fn pins_of_port_a_are_logged_with_their_value() {
        let line =
            "memory_region_ops_write cpu 0 mr 0x55a0 addr 0x40020018 value 0x20000 size 4 name 'GPIOA'\n";
        assert_eq!(parse(line), [TraceEvent::SwitchedPortA(1 << 17)]);
    }

    const fn step(at: u64) -> TraceEvent {
        TraceEvent::Step { at, in_handler: true }
    }

    #[test]
    fn handlers_are_followed_to_their_return_through_what_they_call() {
        let effects =
            [(11, Effect::Call(50)), (50, Effect::Return), (12, Effect::Return), (20, Effect::Return)];
        let effects = HashMap::from(effects);
        let events = [10, 11, 50, 12, 20, 10].map(step);
        assert_eq!(handler_calls(&events, 10, &[10, 20], &effects), [&events[..4]]);
        assert_eq!(handler_calls(&events, 20, &[10, 20], &effects), [&events[4..5]]);
    }

    #[test]
    fn interrupted_handlers_do_not_count() {
        let effects = HashMap::from([(12, Effect::Return), (20, Effect::Return)]);
        let events = [10, 11, 20, 12].map(step);
        assert!(handler_calls(&events, 10, &[10, 20], &effects).is_empty());
    }

    #[test]
    fn ranges_begin_and_end_at_marks() {
        let events = [
            TraceEvent::Read(1),
            TraceEvent::Read(2),
            TraceEvent::Read(1),
            TraceEvent::Read(1),
            TraceEvent::Read(3),
        ];
        assert_eq!(between(&events, |event| *event == TraceEvent::Read(1)), [0..2, 2..3]);
    }
}

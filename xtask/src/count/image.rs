//! The image for the arm, counted from the outside: what it executes between one event on its lines and another.

use std::collections::HashMap;
use std::thread::sleep;
use std::time::Duration;

use protocol_core::registers::JOINTS;
use protocol_core::registers::map::{PRESENT_POSITION, SPEED, TARGET_POSITION};
use protocol_core::request::Request;

use super::machine::{Machine, frame};
use super::trace::{self, Event};
use crate::budget::Figure;
use crate::elf::Program;
use crate::run::{IMAGE, Outcome};
use crate::thumb_decode::Effect;

/// Data registers of the two lines (RM0090, section 30.6.2).
const HOST_DATA: u64 = 0x4001_1004;
/// See above.
const SERVO_DATA: u64 = 0x4000_4404;
/// How often a request is sent at most.
const TRIES: usize = 400;
/// How many requests that nothing disturbed are enough.
const SAMPLES: usize = 48;
/// How long the arm is watched while it moves: some forty control cycles.
const WATCH: Duration = Duration::from_secs(4);
/// How often it is watched at most, until the machine has had time for enough of it.
const WATCHES: usize = 20;
/// Control cycles that are enough.
const CYCLES: usize = 20;
/// How long the arm is left alone.
const SILENCE: Duration = Duration::from_secs(4);
/// Milliseconds after which an arm that is left alone does the same again: it asks missing servos ten times a second,
/// and its LED blinks twice.
const PATTERN: usize = 500;
/// How many requests stand behind a false header: a header claims 262 bytes at most.
const HELD_UP: usize = 34;
/// How often that is tried.
const HELD_UP_TRIES: usize = 9;
/// Time enough for the arm to give the false header up (D4).
const FORGOTTEN: Duration = Duration::from_millis(300);
/// Bytes of the frame that gives seven joints their goals. Nothing else that goes to the servos is as long.
const GOALS: usize = 57;
/// Bytes that the transmitter of a USART takes at once at most: one to shift out, one to wait.
const TRANSMITTER_HOLDS: u64 = 2;

const READ: Request<'_> = Request::Read { address: PRESENT_POSITION.address, count: PRESENT_POSITION.count };
const POSE: [u8; JOINTS] = [90, 90, 65, 90, 90, 90, 80];

/// Where what matters stands in the image.
struct Places {
    sleeps: Vec<u64>,
    host_interrupt: u64,
    servo_interrupt: u64,
    wake_up: u64,
    handlers: Vec<u64>,
    effects: HashMap<u64, Effect>,
}

/// Counts.
pub(crate) fn figures() -> Outcome<Vec<Figure>> {
    let file = IMAGE.read()?;
    let places = Places::of(&Program::read(&file)?)?;
    let silence = places.silence()?;
    let mut machine = Machine::with_servos()?;
    let write = Request::Write { address: TARGET_POSITION.address, values: &POSE };
    let answered = |event: &Event| *event == Event::Wrote(HOST_DATA);
    let asleep = |event: &Event| places.is_sleep(event);
    let read = places.paths(&mut machine, READ, 1, answered)?;
    let read_whole = places.paths(&mut machine, READ, 1, asleep)?;
    let write = places.paths(&mut machine, write, 1, asleep)?;
    let last_but_one = places.paths(&mut machine, READ, 2, asleep)?;
    let first = places.paths(&mut machine, READ, 7, asleep)?;
    let held_up = places.behind_a_false_header(&mut machine)?;
    let moving = while_moving(&mut machine)?;
    let mut figures = vec![
        Figure::new("image: 10 ms with nobody on its lines", silence),
        Figure::new("image: read of 7, last byte in to first byte out", read),
        Figure::new("image: read of 7, last byte in to asleep again", read_whole),
        Figure::new("image: write of 7, last byte in to asleep again", write),
        Figure::new("image: last byte but one of a request, in to asleep again", last_but_one),
        Figure::new("image: byte that is not worth a turn of the loop, in to asleep again", first),
        Figure::new("image: milliseconds that 34 reads are held up by a false header", held_up),
    ];
    figures.extend(places.turns(&moving)?);
    figures.extend(places.interrupts(&moving)?);
    Ok(figures)
}

/// What the arm executes while all joints are on their way. A busy machine may show too little of it: then it is
/// watched on the way back.
fn while_moving(machine: &mut Machine) -> Outcome<Vec<Event>> {
    machine.send(&frame(Request::Write { address: SPEED.address, values: &[5; JOINTS] }))?;
    for target in [0, 90].into_iter().cycle().take(WATCHES) {
        let values = &[target; JOINTS];
        machine.send(&frame(Request::Write { address: TARGET_POSITION.address, values }))?;
        let events = watch_for(machine, WATCH)?;
        if trace::times(&events, Event::Wrote(SERVO_DATA)) >= CYCLES * GOALS {
            return Ok(events);
        }
    }
    Err("the log shows too few control cycles".into())
}

/// What the arm executes by itself for a while.
fn watch_for(machine: &mut Machine, time: Duration) -> Outcome<Vec<Event>> {
    machine.watch(|_| {
        sleep(time);
        Ok(())
    })
}

impl Places {
    fn of(program: &Program<'_>) -> Outcome<Self> {
        Ok(Self {
            sleeps: program.places_of(Effect::WaitForInterrupt),
            host_interrupt: program.address_of("USART1")?,
            servo_interrupt: program.address_of("USART2")?,
            wake_up: program.address_of("SysTick")?,
            handlers: program.handlers().to_vec(),
            effects: program.effects(),
        })
    }

    fn is_sleep(&self, event: &Event) -> bool {
        self.sleeps.iter().any(|&at| trace::is_step_at(event, at))
    }

    /// Instructions in ten milliseconds, the most of many stretches of ten: all that the arm does by itself, which is
    /// one control cycle, ten looks at its lines, and questions to servos that are not there.
    fn silence(&self) -> Outcome<u64> {
        let mut machine = Machine::alone()?;
        // What is done repeats itself ten times a second, in the time of the emulator, which flies.
        sleep(SILENCE);
        for _ in 0..WATCHES {
            let events = watch_for(&mut machine, SILENCE)?;
            let ticks = trace::between(&events, |event| trace::is_step_at(event, self.wake_up));
            let millis: Vec<_> =
                ticks.into_iter().filter_map(|tick| Some(trace::steps(events.get(tick)?))).collect();
            if millis.len() >= PATTERN {
                // Ten ticks are less than 10 ms: the one that begins a control cycle comes sooner than its turn.
                let most = millis.windows(11).map(|millis| millis.iter().sum()).max();
                return Ok(most.unwrap_or(0));
            }
        }
        Err("the log shows too few milliseconds of silence".into())
    }

    /// Instructions from the interrupt that brings a byte of a request, counted from its last one, until `end`. The
    /// arm sleeps when that byte comes, and nothing else comes in between. There is a pause before it, which makes the
    /// search behind an unfinished frame look, too.
    fn paths(
        &self,
        machine: &mut Machine,
        request: Request<'_>,
        from_last: usize,
        end: impl Fn(&Event) -> bool,
    ) -> Outcome<u64> {
        let mut paths = Vec::new();
        for _ in 0..TRIES {
            let events = feed(machine, request, from_last)?;
            paths.extend(self.path(&events, &end));
            if paths.len() >= SAMPLES {
                break;
            }
        }
        typical(paths, "a request that nothing disturbs")
    }

    /// Milliseconds from the last of many requests that a header in noise could claim to the first answer: the gap of
    /// 2 ms (D4), and what the firmware adds to it. The least of several, as the tick may come at once or late.
    fn behind_a_false_header(&self, machine: &mut Machine) -> Outcome<u64> {
        let mut requests = vec![0xAA, 0x77, 6, 0, 0xFF];
        requests.extend(frame(READ).repeat(HELD_UP));
        let mut delays = Vec::new();
        for _ in 0..HELD_UP_TRIES {
            let events = machine.watch(|machine| {
                machine.send(&requests)?;
                (0..HELD_UP).try_for_each(|_| machine.reply(PRESENT_POSITION.count).map(|_| ()))
            })?;
            sleep(FORGOTTEN);
            let answer = events.iter().position(|event| *event == Event::Wrote(HOST_DATA));
            let events = events.get(..answer.unwrap_or(0)).unwrap_or_default();
            if let Some(last) = events.iter().rposition(|event| *event == Event::Read(HOST_DATA)) {
                let ticks =
                    events.iter().skip(last).filter(|event| trace::is_step_at(event, self.wake_up)).count();
                delays.push(ticks as u64);
            }
        }
        let least = delays.into_iter().min();
        Ok(least.ok_or("nothing was held up by a false header")?)
    }

    /// `None` where the arm was awake, or anything else came in between.
    fn path(&self, events: &[Event], end: impl Fn(&Event) -> bool) -> Option<u64> {
        let byte = events.iter().position(|event| *event == Event::Read(HOST_DATA))?;
        let is_entry = |event: &Event| trace::is_step_at(event, self.host_interrupt);
        let start = events.get(..byte)?.iter().rposition(is_entry)?;
        let (before, path) = events.split_at_checked(start)?;
        let was_asleep = self.is_asleep_after(before);
        let path = path.get(..=path.iter().position(end)?)?;
        let others = self.handlers.iter().filter(|&&handler| handler != self.host_interrupt);
        let is_disturbed =
            others.into_iter().any(|&at| path.iter().any(|event| trace::is_step_at(event, at)));
        (was_asleep && !is_disturbed).then(|| trace::steps(path))
    }

    /// Does the loop sleep after this, and has nothing come yet that would wake it? The look that comes before the
    /// sleep shuts interrupts out, so it may be some instructions further, letting them in again. Where the log says
    /// nothing, it slept all along.
    fn is_asleep_after(&self, events: &[Event]) -> bool {
        let last = events.iter().rev().find_map(|event| match event {
            Event::Step { at, in_handler } => Some((*at, *in_handler)),
            _ => None,
        });
        let is_sleep = |at| self.sleeps.iter().any(|&sleep| (sleep..=sleep + 8).contains(&at));
        last.is_none_or(|(at, in_handler)| !in_handler && is_sleep(at))
    }

    /// Turns of the loop from waking to sleeping, in which nothing was received.
    fn turns(&self, events: &[Event]) -> Outcome<[Figure; 2]> {
        let (mut cycles, mut others) = (Vec::new(), Vec::new());
        for turn in trace::between(events, |event| self.is_sleep(event)) {
            let turn = events.get(turn).unwrap_or_default();
            if trace::times(turn, Event::Read(SERVO_DATA)) > 0 {
                continue;
            }
            match trace::times(turn, Event::Wrote(SERVO_DATA)) {
                GOALS.. => cycles.push(trace::steps(turn)),
                0 => others.push(trace::steps(turn)),
                _ => {}
            }
        }
        Ok([
            Figure::new(
                "image: turn of the loop that moves seven joints",
                typical(cycles, "a control cycle")?,
            ),
            Figure::new("image: turn of the loop with nothing to do", typical(others, "an idle turn")?),
        ])
    }

    /// The interrupt of a line, which is the same code for both.
    fn interrupts(&self, events: &[Event]) -> Outcome<[Figure; 3]> {
        let calls = trace::handler_calls(events, self.servo_interrupt, &self.handlers, &self.effects);
        let which = |received, sent| {
            let matches = |call: &&&[Event]| {
                trace::times(call, Event::Read(SERVO_DATA)) == received
                    && trace::times(call, Event::Wrote(SERVO_DATA)) == sent
            };
            let counts = calls.iter().filter(matches).map(|call| trace::steps(call));
            counts.max().ok_or("the log does not show an interrupt of every kind")
        };
        let (receives, sends_one, sends_eight) = (which(1, 0)?, which(0, 1)?, which(0, 8)?);
        let per_byte_sent = (sends_eight - sends_one) / 7;
        Ok([
            Figure::new("image: interrupt that receives a byte", receives),
            Figure::new("image: interrupt that sends a byte", sends_one),
            Figure::new("image: worst interrupt", receives + TRANSMITTER_HOLDS * per_byte_sent),
        ])
    }
}

/// Sends a request so that the arm is asleep when one of its bytes comes, and gives what it executes from then on.
/// The last byte is 1.
fn feed(machine: &mut Machine, request: Request<'_>, from_last: usize) -> Outcome<Vec<Event>> {
    let bytes = frame(request);
    let (before, rest) = bytes.split_at(bytes.len() - from_last);
    let (byte, after) = rest.split_at(1);
    machine.send(before)?;
    let events = machine.watch(|machine| machine.send(byte))?;
    machine.send(after)?;
    // On a machine so busy that the pause got too long (D4) there is no reply, and another try.
    machine.settle()?;
    Ok(events)
}

/// The median: one in several times something else is due in the same moment, such as a question to a servo, and how
/// often depends on how busy the machine is.
fn typical(mut counts: Vec<u64>, what: &str) -> Outcome<u64> {
    counts.sort_unstable();
    let median = counts.get(counts.len() / 2).copied();
    Ok(median.ok_or_else(|| format!("the log does not show {what}"))?)
}

//! Counts instructions of the image for the arm: for requests, passes of its loop, interrupts and idle time.

use std::collections::HashMap;
use std::iter::repeat_n;
use std::thread::sleep;
use std::time::Duration;

use protocol_core::registers::JOINTS;
use protocol_core::registers::map::{FINE_TARGET, PRESENT_POSITION, SPEED, TARGET_POSITION};
use protocol_core::request::Request;

use super::direction;
use super::masked::longest_stretch;
use crate::budget::Figure;
use crate::run::{IMAGE, TaskResult};
use emulator::frame;
use emulator::logged_image::LoggedImage;
use emulator::trace::{self, TraceEvent};
use linked_image::Effect;
use linked_image::Program;

/// Data registers of the USARTs of host link and servo bus (RM0090, section 30.6.2).
const HOST_DATA: u64 = 0x4001_1004;
const SERVO_DATA: u64 = 0x4000_4404;
/// The largest number of requests for one count.
const TRIES: usize = 400;
/// A count ends after this many undisturbed requests.
const SAMPLES: usize = 24;
/// The time of a log of the moving arm: about forty control cycles.
const WATCH_TIME: Duration = Duration::from_secs(4);
/// The largest number of logs of the moving arm, and of the idle arm after its first five. A busy machine may show few control
/// cycles in one log.
const MAX_WATCHES: usize = 20;
/// The number of control cycles that a log of the moving arm must show.
const MIN_CYCLES: usize = 20;
/// The time of a log of the idle arm.
const SILENCE: Duration = Duration::from_secs(4);
/// A log of the idle arm must have this many milliseconds. In this time, the arm reads missing servos five times, and its LED
/// goes on or off about twice.
const PATTERN_MILLIS: usize = 500;
/// The log lines of each second.
const LOG_LINES: usize = 3;
/// The number of requests after a false header. A header claims up to 262 bytes.
const DELAYED_READS: usize = 34;
/// The number of measurements of the delay of these requests.
const DELAY_TRIES: usize = 9;
/// The time after which the arm has dropped a false header (D4).
const DROP_TIME: Duration = Duration::from_millis(300);
/// Bytes of the frame with seven goals. It is the longest frame to the servos.
const GOAL_FRAME_BYTES: usize = 57;
/// Bytes that the loop queues at once. The emulator's transmitter is always empty, so one interrupt sends them all. For the
/// frame of goals, seven interrupts send 8 bytes each, and one sends 1 byte.
const SEND_CHUNK: usize = 8;
/// Bytes that the transmitter of a USART holds: one in the shift register and one in the data register.
const TRANSMITTER_BYTES: u64 = 2;

const READ: Request<'_> = Request::Read { address: PRESENT_POSITION.address, count: PRESENT_POSITION.count };
const POSE: [u8; JOINTS] = [90, 90, 65, 90, 90, 90, 80];
/// 90 degrees in hundredths, low byte first.
const FINE_POSE: [[u8; 2]; JOINTS] = [[0x28, 0x23]; JOINTS];

struct ImageAddresses {
    sleeps: Vec<u64>,
    host_interrupt: u64,
    servo_interrupt: u64,
    wake_up: u64,
    /// The address at which a log line begins. There the image masks the interrupts.
    log_line: u64,
    handlers: Vec<u64>,
    effects: HashMap<u64, Effect>,
}

/// Instructions of the idle arm.
struct Silence {
    ten_millis: u64,
    /// The longest stretch with interrupts masked, log lines included.
    masked: u64,
}

/// Instructions of iterations of the loop.
struct Passes {
    /// An iteration that moves seven joints.
    cycle: u64,
    /// The part of `cycle` from the wake-up to the first byte of the goals.
    first_goal_byte: u64,
    /// An iteration with nothing to do.
    idle: u64,
}

/// Counts the instructions of the image.
pub(crate) fn figures() -> TaskResult<Vec<Figure>> {
    let file = IMAGE.read()?;
    let addresses = ImageAddresses::of(&Program::read(&file)?)?;
    let silence = addresses.silence()?;
    let delayed = behind_a_false_header()?;
    let mut image = LoggedImage::with_servos()?;
    let write = Request::Write { address: TARGET_POSITION.address, values: &POSE };
    let answered = |event: &TraceEvent| *event == TraceEvent::Wrote(HOST_DATA);
    let asleep = |event: &TraceEvent| addresses.is_sleep(event);
    let read = addresses.paths(&mut image, READ, 1, answered)?;
    let read_whole = addresses.paths(&mut image, READ, 1, asleep)?;
    let write = addresses.paths(&mut image, write, 1, asleep)?;
    let fine = Request::Write { address: FINE_TARGET.address, values: FINE_POSE.as_flattened() };
    let fine = addresses.paths(&mut image, fine, 1, asleep)?;
    let last_but_one = addresses.paths(&mut image, READ, 2, asleep)?;
    let first = addresses.paths(&mut image, READ, 7, asleep)?;
    let moving = while_moving(&mut image)?;
    direction::check(&moving)?;
    let mut figures = vec![
        Figure::new("image: 10 ms without traffic", silence.ten_millis),
        Figure::new("image: read of 7, last byte in to first byte out", read),
        Figure::new("image: read of 7, last byte in to asleep again", read_whole),
        Figure::new("image: write of 7, last byte in to asleep again", write),
        Figure::new("image: write of 7 fine targets, last byte in to asleep again", fine),
        Figure::new("image: last byte but one of a request, in to asleep again", last_but_one),
        Figure::new("image: byte that needs no pass of the loop, in to asleep again", first),
        Figure::new("image: microseconds that 34 reads are held up by a false header", delayed),
    ];
    let passes = addresses.passes(&moving)?;
    let masked = silence.masked.max(longest_stretch(&moving, &addresses.effects));
    figures.extend([
        Figure::new("image: pass of the loop that moves seven joints", passes.cycle),
        Figure::new("image: pass of the loop with nothing to do", passes.idle),
        Figure::new("image: control cycle, wake-up to first byte of seven goals", passes.first_goal_byte),
        Figure::new("image: longest stretch with interrupts masked", masked),
    ]);
    figures.extend(addresses.interrupts(&moving)?);
    Ok(figures)
}

/// Logs the arm while all joints move. If a log shows too few control cycles, as on a busy machine, logs the next move instead.
fn while_moving(image: &mut LoggedImage) -> TaskResult<Vec<TraceEvent>> {
    image.send(&frame(Request::Write { address: SPEED.address, values: &[5; JOINTS] }))?;
    for target in [0, 90].into_iter().cycle().take(MAX_WATCHES) {
        let values = &[target; JOINTS];
        image.send(&frame(Request::Write { address: TARGET_POSITION.address, values }))?;
        let events = watch_for(image, WATCH_TIME)?;
        if trace::times(&events, TraceEvent::Wrote(SERVO_DATA)) >= MIN_CYCLES * GOAL_FRAME_BYTES {
            return Ok(events);
        }
    }
    Err("the log shows too few control cycles".into())
}

/// Logs the arm for this time.
fn watch_for(image: &mut LoggedImage, time: Duration) -> TaskResult<Vec<TraceEvent>> {
    image.watch(|_| {
        sleep(time);
        Ok(())
    })
}

/// The delay of requests behind a false header, in microseconds: from the last request to the first reply. It consists of the gap
/// of 2 ms (D4), up to a tick until the loop takes the bytes, and up to a tick by which the measurement begins too early.
/// Returns the largest of several measurements.
fn behind_a_false_header() -> TaskResult<u64> {
    let mut image = LoggedImage::alone()?;
    let mut requests = vec![0xAA, 0x77, 6, 0, 0xFF];
    requests.extend(frame(READ).repeat(DELAYED_READS));
    let mut delays = Vec::new();
    for _ in 0..DELAY_TRIES {
        let events = image.watch(|image| {
            image.send(&requests)?;
            (0..DELAYED_READS).try_for_each(|_| image.reply(PRESENT_POSITION.count).map(|_| ()))
        })?;
        sleep(DROP_TIME);
        delays.extend(first_reply_after_micros(&events));
    }
    Ok(delays.into_iter().max().ok_or("nothing was held up by a false header")?)
}

/// Microseconds between two readings of the time: the last reading before the last byte of the host, and the last reading before
/// the first reply.
fn first_reply_after_micros(events: &[TraceEvent]) -> Option<u64> {
    let reply = events.iter().position(|event| *event == TraceEvent::Wrote(HOST_DATA))?;
    let (waiting, _) = events.split_at_checked(reply)?;
    let last_byte = waiting.iter().rposition(|event| *event == TraceEvent::Read(HOST_DATA))?;
    let (receiving, _) = waiting.split_at_checked(last_byte)?;
    Some(last_time(waiting)? - last_time(receiving)?)
}

/// The last reading of the time, in microseconds.
fn last_time(events: &[TraceEvent]) -> Option<u64> {
    events
        .iter()
        .rev()
        .find_map(|event| if let TraceEvent::Time(micros) = event { Some(*micros) } else { None })
}

impl ImageAddresses {
    fn of(program: &Program<'_>) -> TaskResult<Self> {
        Ok(Self {
            sleeps: program.addresses_of(Effect::WaitForInterrupt),
            host_interrupt: program.address_of("USART1")?,
            servo_interrupt: program.address_of("USART2")?,
            wake_up: program.address_of("SysTick")?,
            log_line: program.address_of("_defmt_acquire")?,
            handlers: program.handlers().to_vec(),
            effects: program.effects(),
        })
    }

    fn is_sleep(&self, event: &TraceEvent) -> bool {
        self.sleeps.iter().any(|&at| trace::is_step_at(event, at))
    }

    /// The figures of the idle arm. `ten_millis` covers one control cycle, ten polls of its lines, and reads of missing servos.
    /// It is a median, because a log may or may not contain the log lines of each second. For `masked`, the logs must contain
    /// all these lines.
    fn silence(&self) -> TaskResult<Silence> {
        let mut image = LoggedImage::alone()?;
        // The pattern repeats in virtual time, which runs fast.
        sleep(SILENCE);
        let (mut log_lines, mut masked) = (0, 0);
        // A busy machine shows less in the same time.
        for times in (1..=5).chain(repeat_n(5, MAX_WATCHES)) {
            let events = watch_for(&mut image, SILENCE * times)?;
            log_lines += events.iter().filter(|event| trace::is_step_at(event, self.log_line)).count();
            masked = masked.max(longest_stretch(&events, &self.effects));
            let ticks = trace::between(&events, |event| trace::is_step_at(event, self.wake_up));
            let millis: Vec<_> =
                ticks.into_iter().filter_map(|tick| Some(trace::steps(events.get(tick)?))).collect();
            if millis.len() >= PATTERN_MILLIS && log_lines >= LOG_LINES {
                // Ten ticks are less than 10 ms, because a control cycle begins before its tick.
                let sums = millis.windows(11).map(|millis| millis.iter().sum()).collect();
                let ten_millis = median(sums, "ten milliseconds of silence")?;
                return Ok(Silence { ten_millis, masked });
            }
        }
        Err("the log shows too few milliseconds of silence, or too few log lines".into())
    }

    /// The median number of instructions from the interrupt of one byte of a request until `end`. `from_last` is 1 for the last
    /// byte. A log counts only if the arm sleeps when the byte arrives and no other event follows. A pause before the byte makes
    /// the deframer search behind the incomplete frame.
    fn paths(
        &self,
        image: &mut LoggedImage,
        request: Request<'_>,
        from_last: usize,
        end: impl Fn(&TraceEvent) -> bool,
    ) -> TaskResult<u64> {
        let mut paths = Vec::new();
        for _ in 0..TRIES {
            let events = send_and_watch(image, request, from_last)?;
            paths.extend(self.path(&events, &end));
            if paths.len() >= SAMPLES {
                break;
            }
        }
        median(paths, "a request that nothing disturbs")
    }

    /// The instructions in one log. `None` if the arm was awake, another event came in between, or the log ends before `end`.
    fn path(&self, events: &[TraceEvent], end: impl Fn(&TraceEvent) -> bool) -> Option<u64> {
        let byte = events.iter().position(|event| *event == TraceEvent::Read(HOST_DATA))?;
        let is_entry = |event: &TraceEvent| trace::is_step_at(event, self.host_interrupt);
        let start = events.get(..byte)?.iter().rposition(is_entry)?;
        let (before, path) = events.split_at_checked(start)?;
        let was_asleep = self.is_asleep_after(before);
        let path = path.get(..=path.iter().position(end)?)?;
        let others = self.handlers.iter().filter(|&&handler| handler != self.host_interrupt);
        let is_disturbed =
            others.into_iter().any(|&at| path.iter().any(|event| trace::is_step_at(event, at)));
        (was_asleep && !is_disturbed).then(|| trace::steps(path))
    }

    /// True if the loop sleeps after these events, and no event has come that would wake it. The poll before the sleep
    /// disables interrupts, so the last events may be instructions that enable them again. Without events, the loop
    /// was asleep.
    fn is_asleep_after(&self, events: &[TraceEvent]) -> bool {
        let last = events.iter().rev().find_map(|event| match event {
            TraceEvent::Step { at, in_handler } => Some((*at, *in_handler)),
            _ => None,
        });
        let is_sleep = |at| self.sleeps.iter().any(|&sleep| (sleep..=sleep + 8).contains(&at));
        last.is_none_or(|(at, in_handler)| !in_handler && is_sleep(at))
    }

    /// The medians over the iterations of the loop, each from one sleep to the next, in which no byte of a servo was received.
    fn passes(&self, events: &[TraceEvent]) -> TaskResult<Passes> {
        let (mut cycles, mut first_bytes, mut others) = (Vec::new(), Vec::new(), Vec::new());
        for pass in trace::between(events, |event| self.is_sleep(event)) {
            let pass = events.get(pass).unwrap_or_default();
            if trace::times(pass, TraceEvent::Read(SERVO_DATA)) > 0 {
                continue;
            }
            match trace::times(pass, TraceEvent::Wrote(SERVO_DATA)) {
                GOAL_FRAME_BYTES.. => {
                    cycles.push(trace::steps(pass));
                    let first = pass.iter().position(|event| *event == TraceEvent::Wrote(SERVO_DATA));
                    first_bytes.extend(first.and_then(|first| pass.get(..first)).map(trace::steps));
                }
                0 => others.push(trace::steps(pass)),
                _ => {}
            }
        }
        Ok(Passes {
            cycle: median(cycles, "a control cycle")?,
            first_goal_byte: median(first_bytes, "a control cycle")?,
            idle: median(others, "an idle pass")?,
        })
    }

    /// Instructions of the interrupts of the servo line. The host link uses the same code.
    fn interrupts(&self, events: &[TraceEvent]) -> TaskResult<[Figure; 3]> {
        let calls = trace::handler_calls(events, self.servo_interrupt, &self.handlers, &self.effects);
        let which = |received, sent| {
            let matches = |call: &&&[TraceEvent]| {
                trace::times(call, TraceEvent::Read(SERVO_DATA)) == received
                    && trace::times(call, TraceEvent::Wrote(SERVO_DATA)) == sent
            };
            let counts = calls.iter().filter(matches).map(|call| trace::steps(call));
            counts.max().ok_or("the log does not show an interrupt of every kind")
        };
        let (receives, sends_one, sends_chunk) = (which(1, 0)?, which(0, 1)?, which(0, SEND_CHUNK)?);
        let per_byte_sent = (sends_chunk - sends_one) / (SEND_CHUNK as u64 - 1);
        Ok([
            Figure::new("image: interrupt that receives a byte", receives),
            Figure::new("image: interrupt that sends a byte", sends_one),
            Figure::new("image: worst interrupt", receives + TRANSMITTER_BYTES * per_byte_sent),
        ])
    }
}

/// Sends a request, and logs how the arm processes one of its bytes. The arm usually sleeps when this byte arrives.
/// `from_last` is 1 for the last byte.
fn send_and_watch(
    image: &mut LoggedImage,
    request: Request<'_>,
    from_last: usize,
) -> TaskResult<Vec<TraceEvent>> {
    let bytes = frame(request);
    let (before, rest) = bytes.split_at(bytes.len() - from_last);
    let (byte, after) = rest.split_first().ok_or("the request has fewer bytes")?;
    image.send(before)?;
    let events = image.watch_byte(*byte)?;
    image.send(after)?;
    // On a busy machine the pause may be too long (D4), so that there is no reply. The caller tries again.
    image.settle()?;
    Ok(events)
}

/// The median. It ignores the few logs in which another event is due at the same time, such as a read of a servo.
fn median(mut counts: Vec<u64>, what: &str) -> TaskResult<u64> {
    counts.sort_unstable();
    let median = counts.get(counts.len() / 2).copied();
    Ok(median.ok_or_else(|| format!("the log does not show {what}"))?)
}

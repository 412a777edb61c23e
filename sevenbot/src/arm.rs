//! An open arm: reads and writes registers, also as typed values, and keeps the reports.
//!
//! Knows the register table. [`HostLink`](host_link::HostLink) knows frames, replies and timeouts.

use std::fmt;
use std::time::{Duration, Instant};

use host_link::{HostEvent, Patience, RequestId};
use protocol_core::registers::map::{CHIP_ID, DEVICE_CODE, OFFSET, SERVO_TEMPERATURE, STATUS_VERSION};
use protocol_core::registers::map21::Map;

use crate::arm_options::ArmOptions;
use crate::blocking_link::BlockingLink;
use crate::error::{Error, OpenError};
use crate::host_line::HostLine;
use crate::identity::{Firmware, Identity};
use crate::map_view::{MapView, WriteFrame};
#[cfg(feature = "serial")]
use crate::network::open_line;
use crate::reports::{Report, ReportQueue, report_period};
use host_link::{Snapshot, Span};

/// The status block, registers 240 to 255.
pub const STATUS: Span = Span::between(&STATUS_VERSION, &SERVO_TEMPERATURE);

/// The smallest number of attempts for each read in [`Arm::with_min_attempts`].
const MIN_ATTEMPTS: u32 = 3;

/// A 7Bot V2 at the other end of a line: a serial port, a server or a simulation.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sevenbot::{Angle, Arm, Joint};
///
/// let mut arm = Arm::open("/dev/ttyUSB0", 115_200)?;
/// if let (Some(base), Some(angle)) = (Joint::new(1), Angle::from_degrees(120)) {
///     arm.set_target(base, angle)?;
/// }
/// println!("{:?}", arm.positions()?);
/// arm.hold()?;
/// # Ok(())
/// # }
/// ```
pub struct Arm {
    link: BlockingLink,
    path: String,
    options: ArmOptions,
    identity: Identity,
    pub(crate) view: MapView,
    background: Option<BackgroundRead>,
    reports: ReportQueue,
}

/// A read that the caller does not wait for. A stream reads the arm's health this way, between its points.
struct BackgroundRead {
    id: RequestId,
    wanted: Span,
    answer: Option<Snapshot>,
}

impl fmt::Debug for Arm {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Arm").field("identity", &self.identity).finish_non_exhaustive()
    }
}

#[cfg(feature = "serial")]
impl Arm {
    /// Opens a port and checks that a 7Bot V2 answers. `path` may be the address of a server: [`Address`](crate::network::Address).
    ///
    /// # Errors
    /// The port cannot be opened or failed, no device answers, or another device answers.
    pub fn open(path: &str, baud: u32) -> Result<Self, OpenError> {
        Self::open_with(path, ArmOptions { baud, ..ArmOptions::default() })
    }

    /// As [`Arm::open`], with timeout, attempts and register map as the options say.
    ///
    /// # Errors
    /// The port cannot be opened or failed, no device answers, or another device answers.
    pub fn open_with(path: &str, options: ArmOptions) -> Result<Self, OpenError> {
        Self::over(open_line(path, options.baud)?, path, options)
    }
}

impl Arm {
    /// Opens the arm at the other end of a line, and checks that a 7Bot V2 answers. [`Arm::port`] returns `name`.
    ///
    /// # Errors
    /// No device answers, another device answers, or the port failed.
    pub fn over(line: Box<dyn HostLine>, name: &str, options: ArmOptions) -> Result<Self, OpenError> {
        let nobody = Identity::from(Snapshot { address: 0, values: Vec::new() });
        let path = name.to_owned();
        let view = MapView { map: Map::V22, firmware: Firmware::Unknown };
        let link = BlockingLink::new(line, options.baud, view.reports());
        let reports = ReportQueue::default();
        let mut arm = Self { link, path, options, identity: nobody, view, background: None, reports };
        // Registers 0 to 7 are the same in both maps.
        arm.identity = Identity::from(arm.read_span(Span::between(&DEVICE_CODE, &CHIP_ID))?);
        let map = options.map.unwrap_or_else(|| arm.identity.map());
        arm.view = MapView { map, firmware: arm.identity.firmware() };
        arm.link.set_reports(arm.view.reports());
        match arm.identity.device_code() {
            code if code == DEVICE_CODE.default_at(DEVICE_CODE.address) => Ok(arm),
            code => Err(OpenError::WrongDevice { code }),
        }
    }

    /// Registers 0 to 7, read when the arm was opened.
    #[must_use]
    pub const fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The register map of the arm's frames. All methods take registers of map 2.2, and registers that only map 2.1 has, and
    /// translate them.
    #[must_use]
    pub const fn map(&self) -> Map {
        self.view.map
    }

    /// Does the arm have this register? The maker's firmware 2.2 lacks those of map 2.1 alone, [`OPTIONS`](crate::map21::OPTIONS)
    /// and 128 to 199 need this project's firmware, and all other addresses count as present, even unused ones.
    #[must_use]
    pub fn serves(&self, address: u8) -> bool {
        self.view.serves(address)
    }

    /// The time between two reports at a frequency of `hertz`. `content` is a value of [`crate::map::report_content`].
    #[must_use]
    pub fn report_period(&self, hertz: u8, content: u8) -> Duration {
        report_period(self.identity.firmware(), hertz, content, self.options.baud)
    }

    /// The name of the port or the address of the server, as given when the arm was opened.
    #[must_use]
    pub fn port(&self) -> &str {
        &self.path
    }

    /// The options with which the arm was opened.
    #[must_use]
    pub const fn options(&self) -> ArmOptions {
        self.options
    }

    /// The values of `count` registers from `address` on, read at one instant.
    ///
    /// # Errors
    /// The registers reach past 255, no attempt is answered, or the port failed.
    pub fn read(&mut self, address: u8, count: u8) -> Result<Vec<u8>, Error> {
        let outside = Error::OutsideMap { address, count: count.into() };
        let span = Span::new(address, count).ok_or(outside)?;
        self.read_span(span).map(|snapshot| snapshot.values)
    }

    /// As [`Arm::read`], for a checked span.
    ///
    /// # Errors
    /// No attempt is answered, or the port failed.
    pub fn read_span(&mut self, span: Span) -> Result<Snapshot, Error> {
        self.take_waiting()?;
        self.link.take_received();
        self.choose_offset_encoding(span);
        let id = self.link.read(self.view.read_span(span), self.patience(self.options.attempts));
        match self.answer(id) {
            Ok(Some(answer)) => Ok(self.view.view(&answer, span)),
            Ok(None) => Err(self.no_answer(span)),
            Err(error) => {
                self.link.cancel(id);
                Err(error)
            }
        }
    }

    fn patience(&self, attempts: u32) -> Patience {
        Patience { attempts: attempts.max(1), timeout: self.options.reply_timeout.into() }
    }

    /// Runs `work` with at least three attempts for each read.
    pub(crate) fn with_min_attempts<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> T {
        self.with_attempts(self.options.attempts.max(MIN_ATTEMPTS), work)
    }

    /// Runs `work` with this number of attempts for each read.
    pub(crate) fn with_attempts<T>(&mut self, attempts: u32, work: impl FnOnce(&mut Self) -> T) -> T {
        let before = std::mem::replace(&mut self.options.attempts, attempts);
        let done = work(self);
        self.options.attempts = before;
        done
    }

    /// Writes the registers from `address` on in one frame: all of them or none ([D16](protocol_core::decisions#d16),
    /// [D17](protocol_core::decisions#d17)). The arm does not answer a write. [`Arm::write_checked`] reads the
    /// registers back.
    ///
    /// Registers that need both maps, or that map 2.1 has elsewhere, are written in several frames. A write to a register that
    /// only map 2.1 has ends the reports of map 2.2 ([M4](protocol_core::decisions#m4)). [`Arm::write_checked`] starts them
    /// again. In map 2.1 the present positions are left out, and with other firmware than ours the registers of inverse kinematics.
    ///
    /// # Errors
    /// The registers reach past 255 or one frame does not hold all (then nothing is sent), or the port failed.
    pub fn write(&mut self, address: u8, values: &[u8]) -> Result<(), Error> {
        Span::of_values(address, values).ok_or(Error::OutsideMap { address, count: values.len() })?;
        let frames = self.view.writes(address, values);
        frames.iter().for_each(|frame| self.link.write(frame));
        if frames.last().is_some_and(|last| last.map != self.view.map) {
            self.claim_offset_encoding();
        }
        self.flush()
    }

    /// Selects the encoding of the offsets. Our firmware shows them in the encoding of the map that was written last, maybe by
    /// another program (M5). A write of 0 registers in this view's map selects that map.
    fn claim_offset_encoding(&mut self) {
        self.link.write(&WriteFrame { map: self.view.map, address: 0, values: Vec::new() });
    }

    fn choose_offset_encoding(&mut self, span: Span) {
        let has_both = self.identity.firmware() == Firmware::Ours;
        if has_both && span.addresses().any(|address| OFFSET.holds(address)) {
            self.claim_offset_encoding();
        }
    }

    /// The time now, on the clock of the arm's line.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.link.now()
    }

    /// The time since this arm was opened, on the clock of its line.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.link.elapsed()
    }

    /// Waits, on the clock of the arm's line.
    pub fn sleep(&mut self, duration: Duration) {
        self.link.sleep(duration);
    }

    /// Takes the reports that earlier calls received, oldest first. Does not read the line.
    pub fn reports(&mut self) -> impl Iterator<Item = Report> {
        self.reports.drain()
    }

    /// The oldest report. Waits for one if there is none; `None` after `timeout`.
    ///
    /// # Errors
    /// The port failed.
    pub fn next_report(&mut self, timeout: Duration) -> Result<Option<Report>, Error> {
        let deadline = self.now() + timeout;
        loop {
            self.flush()?;
            let report = self.reports.pop();
            if report.is_some() {
                return Ok(report);
            }
            let Some(event) = self.link.next(Some(deadline))? else { return Ok(None) };
            self.keep(event);
        }
    }

    /// Waits for the end of a read; `None` if there is no reply.
    fn answer(&mut self, id: RequestId) -> Result<Option<Snapshot>, Error> {
        while let Some(event) = self.link.next(None)? {
            match event {
                HostEvent::Reply(replied, values) if replied == id => return Ok(Some(values)),
                HostEvent::NoReply(lost, _) if lost == id => return Ok(None),
                other => self.keep(other),
            }
        }
        Ok(None)
    }

    /// Asks for registers without waiting for the answer. Drops an earlier background question, and its answer if it was not
    /// taken.
    ///
    /// # Errors
    /// The port failed.
    pub(crate) fn ask_in_background(&mut self, wanted: Span) -> Result<(), Error> {
        self.forget_background_question();
        let id = self.link.read(self.view.read_span(wanted), self.patience(1));
        self.background = Some(BackgroundRead { id, wanted, answer: None });
        self.flush()
    }

    /// Gives up the last background question, and drops its answer.
    pub(crate) fn forget_background_question(&mut self) {
        if let Some(read) = self.background.take() {
            self.link.cancel(read.id);
        }
    }

    /// Takes the answer to the last background question, if it has arrived.
    ///
    /// # Errors
    /// The port failed.
    pub(crate) fn take_background_answer(&mut self) -> Result<Option<Snapshot>, Error> {
        self.take_waiting()?;
        let Some(read) = self.background.take_if(|read| read.answer.is_some()) else { return Ok(None) };
        Ok(read.answer.map(|answer| self.view.view(&answer, read.wanted)))
    }

    /// The error for background questions without an answer within `waited`. Resets the counts of what was received.
    pub(crate) fn no_background_answer(&mut self, span: Span, waited: Duration) -> Error {
        let received = self.link.take_received();
        Error::NoAnswer { span, attempts: 1, waited, received }
    }

    fn no_answer(&mut self, span: Span) -> Error {
        let ArmOptions { attempts, reply_timeout, .. } = self.options;
        let received = self.link.take_received();
        Error::NoAnswer { span, attempts: attempts.max(1), waited: reply_timeout, received }
    }

    /// Sends what is queued, and keeps what was received.
    fn flush(&mut self) -> Result<(), Error> {
        loop {
            match self.link.poll()? {
                HostEvent::Wait(_) => return Ok(()),
                event => self.keep(event),
            }
        }
    }

    /// As [`Self::flush`], but first takes the bytes that wait in the line: reports and late replies.
    fn take_waiting(&mut self) -> Result<(), Error> {
        loop {
            let has_bytes = self.link.receive(Duration::ZERO)?;
            self.flush()?;
            if !has_bytes {
                return Ok(());
            }
        }
    }

    /// Keeps a report, and the answer to the background question.
    fn keep(&mut self, event: HostEvent) {
        match event {
            HostEvent::Report(map, report) => self.reports.keep(map, &report, self.view, self.link.now()),
            HostEvent::Reply(id, values) => {
                let read = self.background.as_mut().filter(|read| read.id == id);
                read.into_iter().for_each(|read| read.answer = Some(values.clone()));
            }
            _ => {}
        }
    }
}

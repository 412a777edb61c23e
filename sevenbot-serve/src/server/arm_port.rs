//! The serial port of the arm: opened again and again while it is not there.

use std::io;
use std::path::PathBuf;

use std::sync::Arc;

use protocol_core::time::{Duration, Instant};

use super::arm_location::{ArmLocation, PortSearch};
use super::arm_serial::ArmSerial;
use super::notice::Notice;
use super::shared::SharedHub;
use crate::hub::Hub;

/// Time between two attempts to open the port.
const RETRY_PERIOD: Duration = Duration::from_millis(500);
/// Time after which an open port without an arm is opened anew: the device behind the path may be another one.
const IDENTIFY_TIMEOUT: Duration = Duration::from_millis(3_000);
/// As [`IDENTIFY_TIMEOUT`], with [`ArmLocation::Search`].
const SEARCH_TIMEOUT: Duration = Duration::from_millis(1_000);

/// The serial port of the arm.
#[derive(Debug)]
pub(super) struct ArmPort {
    path: PathBuf,
    search: Option<PortSearch>,
    baud: u32,
    state: ArmPortState,
    /// The last notice, so that it is not repeated.
    last_notice: Option<Notice>,
}

#[derive(Debug)]
enum ArmPortState {
    /// When to try to open the port again.
    Closed(Instant),
    /// The port, and when it was opened, or when the arm was last present.
    Open(ArmSerial, Instant),
}

impl ArmPort {
    pub(super) fn new(location: ArmLocation, baud: u32) -> Self {
        let (path, search) = match location {
            ArmLocation::Port(path) => (path, None),
            ArmLocation::Search { first, list } => (first, Some(PortSearch::new(list))),
        };
        Self { path, search, baud, state: ArmPortState::Closed(Instant::ZERO), last_notice: None }
    }

    /// Serves the arm for ever.
    pub(super) async fn serve(mut self, shared: Arc<SharedHub>, mut notify: impl FnMut(Notice)) {
        loop {
            let (deadline, has_output) = shared.with_hub(|hub, now| {
                self.receive(hub, now, &mut notify);
                hub.poll(now);
                self.send(hub, now, &mut notify);
                hub.take_failed_hold().map(Notice::HoldFailed).into_iter().for_each(&mut notify);
                (hub.deadline(now).min(self.deadline(hub)), !hub.to_arm().is_empty())
            });
            tokio::select! {
                () = self.is_ready(has_output) => {}
                () = shared.clients_acted() => {}
                () = shared.sleep_until(deadline) => {}
            }
        }
    }

    /// Ends when the port has bytes to read, or, if `has_output`, when the port takes bytes.
    async fn is_ready(&self, has_output: bool) {
        let ArmPortState::Open(port, _) = &self.state else { return std::future::pending().await };
        // Ignore an error here: the next read or write returns it.
        let _ = tokio::select! {
            ready = port.readable() => ready,
            ready = port.writable(), if has_output => ready,
        };
    }

    /// Opens the port if that is due, and passes bytes of the arm to the hub. Closes the port after an error, or if no arm
    /// has answered in time.
    fn receive(&mut self, hub: &mut Hub, now: Instant, notify: &mut dyn FnMut(Notice)) {
        let timeout = self.identify_timeout();
        match &mut self.state {
            ArmPortState::Closed(due) if *due <= now => self.open(hub, now, notify),
            ArmPortState::Closed(_) => {}
            ArmPortState::Open(port, since) => {
                let had_arm = hub.has_arm();
                let outcome = read_all(port, hub, now);
                if hub.has_arm() {
                    *since = now;
                }
                let is_late = *since + timeout <= now;
                match outcome {
                    Err(error) => self.close(hub, now, notify, &error.to_string()),
                    Ok(()) if hub.has_arm() && !had_arm => {
                        if let Some(search) = &mut self.search {
                            search.found(&self.path);
                            hub.expect_same_arm();
                        }
                        self.notify(Notice::ArmFound(self.path.clone()), notify);
                    }
                    Ok(()) if self.stays_open(hub) => {
                        self.notify(Notice::ArmSilent(self.path.clone()), notify);
                    }
                    Ok(()) if !hub.has_arm() && is_late => {
                        self.notify(Notice::ArmSilent(self.path.clone()), notify);
                        hub.close_arm();
                        self.state = ArmPortState::Closed(now + RETRY_PERIOD);
                    }
                    Ok(()) => {}
                }
            }
        }
    }

    /// Does the port of a silent arm stay open? Then a stop may still reach the arm, and the port reports an error when the
    /// adapter is unplugged. With a search the port is closed, so that other names can be tried.
    const fn stays_open(&self, hub: &Hub) -> bool {
        hub.is_silent() && self.search.is_none()
    }

    fn send(&mut self, hub: &mut Hub, now: Instant, notify: &mut dyn FnMut(Notice)) {
        let ArmPortState::Open(port, ..) = &self.state else { return };
        if hub.to_arm().is_empty() {
            return;
        }
        match port.write(hub.to_arm()) {
            Ok(count) => hub.sent_to_arm(count),
            Err(error) => self.close(hub, now, notify, &error.to_string()),
        }
    }

    /// When to call [`ArmPort::receive`] without other events.
    fn deadline(&self, hub: &Hub) -> Instant {
        match &self.state {
            ArmPortState::Closed(due) => *due,
            // The timeout applies only while no arm answers, and not if the port of a silent arm stays open.
            ArmPortState::Open(.., since) if !hub.has_arm() && !self.stays_open(hub) => {
                *since + self.identify_timeout()
            }
            ArmPortState::Open(..) => Instant::FAR_FUTURE,
        }
    }

    const fn identify_timeout(&self) -> Duration {
        if self.search.is_some() { SEARCH_TIMEOUT } else { IDENTIFY_TIMEOUT }
    }

    fn open(&mut self, hub: &mut Hub, now: Instant, notify: &mut dyn FnMut(Notice)) {
        if let Some(path) = self.search.as_mut().and_then(|search| search.next(&self.path)) {
            self.path = path;
        }
        match ArmSerial::open(&self.path, self.baud) {
            Ok(port) => {
                self.state = ArmPortState::Open(port, now);
                hub.open_arm(now);
            }
            Err(error) => self.close(hub, now, notify, &error.to_string()),
        }
    }

    fn close(&mut self, hub: &mut Hub, now: Instant, notify: &mut dyn FnMut(Notice), reason: &str) {
        hub.close_arm();
        self.state = ArmPortState::Closed(now + RETRY_PERIOD);
        self.notify(Notice::ArmLost { port: self.path.clone(), reason: reason.to_owned() }, notify);
    }

    /// Passes a notice, unless it equals the last one. While a search finds no arm, passes only the first notice.
    fn notify(&mut self, notice: Notice, notify: &mut dyn FnMut(Notice)) {
        let is_found = |notice: &Notice| matches!(notice, Notice::ArmFound(_));
        let is_known = match &self.last_notice {
            Some(last) if self.search.is_some() && !is_found(last) => !is_found(&notice),
            last => last.as_ref() == Some(&notice),
        };
        if !is_known {
            notify(notice.clone());
            self.last_notice = Some(notice);
        }
    }
}

/// Passes all bytes that have arrived. If there are none, an empty slice states that the line is silent.
fn read_all(port: &ArmSerial, hub: &mut Hub, now: Instant) -> io::Result<()> {
    let mut bytes = [0; 4_096];
    loop {
        let count = port.read(&mut bytes)?;
        hub.arm_bytes(now, bytes.get(..count).unwrap_or(&[]));
        if count < bytes.len() {
            return Ok(());
        }
    }
}

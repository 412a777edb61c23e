//! The shell's loop round the controller, with a check of every output.

use motion_core::{Output, Vacuum};
use protocol_core::registers::Image;
use protocol_core::registers::map::{FRAMES_ACCEPTED, FRAMES_REFUSED};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::deframer;

use super::command_checker::CommandContext;
use super::extended_model;
use super::host_request::{MAX_LENGTH, alarm, reply, report};
use super::power::random_cut;
use super::register_model::RequestEffect;
use super::report_checker::ReportStream;
use super::settings_storage::PowerOutcome;
use super::state::{PoweredArm, TortureWorld};
use crate::violation::{Check, Violation, ensure};

/// The number of outputs after which the controller has to wait. Each waiting request causes at most one output, and
/// fewer than this many wait.
const MAX_OUTPUTS: u32 = 4_000;
/// This many consecutive waits for a time that has passed are a violation.
const MAX_EXPIRED_WAITS: u32 = 4;

/// An [`Output`] without a borrow of the controller: its bytes are in [`PoweredArm::output_bytes`].
enum OwnedOutput {
    ToHost,
    ToServos,
    Vacuum(Vacuum),
    Save(Image),
    Wait(Instant),
}

impl PoweredArm {
    fn poll(&mut self, now: Instant, room: usize) -> OwnedOutput {
        let Self { controller, output_bytes, .. } = self;
        let mut copy = |bytes: &[u8], output| {
            output_bytes.clear();
            output_bytes.extend_from_slice(bytes);
            output
        };
        match controller.poll(now, room) {
            Output::ToHost(bytes) => copy(bytes, OwnedOutput::ToHost),
            Output::ToServos(bytes) => copy(bytes, OwnedOutput::ToServos),
            Output::Vacuum(vacuum) => OwnedOutput::Vacuum(vacuum),
            Output::Save(image) => OwnedOutput::Save(image),
            Output::Wait(until) => OwnedOutput::Wait(until),
        }
    }

    /// The number of requests that the controller has accepted or refused, modulo 65 536.
    fn executed(&self) -> u16 {
        let registers = self.controller.registers();
        let count = |at: u8| u16::from_le_bytes([registers.get(at), registers.get(at + 1)]);
        count(FRAMES_ACCEPTED.address).wrapping_add(count(FRAMES_REFUSED.address))
    }

    /// Passes the waiting host bytes, perhaps none, to the controller. Returns true if the controller took any.
    fn deliver_host_bytes(&mut self, now: Instant) -> bool {
        let taken = self.controller.host_bytes(now, self.to_arm.waiting());
        if taken > 0 {
            self.to_arm.take(now, taken);
        }
        taken > 0
    }

    /// Checks that every complete request was executed, if the line has been silent for the gap time after it.
    fn check_pending(&self, now: Instant, room: usize) -> Check {
        let Some(first) = self.pending.front() else { return Ok(()) };
        let gap = deframer::gap(self.controller.baud());
        // A write needs no room. A read needs room for its reply (D5).
        let is_due = first.arrived_at + gap <= now && room >= first.request.reply_length();
        let is_silent = self.to_arm.next_arrival().is_none_or(|at| at > now);
        let last = self.to_arm.last_taken_at();
        ensure(!(is_due && is_silent && now >= last + gap), || {
            format!("{} requests were not executed, the first is {first:?}", self.pending.len())
        })
    }
}

impl TortureWorld {
    /// Runs the shell's loop once. Returns true if the power is still on.
    pub(super) fn run_loop(&mut self, arm: &mut PoweredArm) -> Check<bool> {
        let bytes = self.bus.receive(self.now, &mut self.rng);
        if !bytes.is_empty() {
            self.log.bus(self.now, "from servos", &bytes);
            arm.command_checker.replies_received(self.now, &bytes);
            arm.controller.servo_bytes(self.now, &bytes);
        }
        while arm.deliver_host_bytes(self.now) {
            if !self.poll(arm)? {
                return Ok(false);
            }
        }
        self.poll(arm)
    }

    /// Executes the outputs of the controller until it waits. Returns true if the power is still on.
    fn poll(&mut self, arm: &mut PoweredArm) -> Check<bool> {
        for _ in 0..MAX_OUTPUTS {
            if self.parameters.receives_before_every_poll {
                arm.deliver_host_bytes(self.now);
            }
            let room = arm.to_host.room(self.now);
            let before = arm.executed();
            let output = arm.poll(self.now, room);
            let count = arm.executed().wrapping_sub(before);
            self.apply_requests(arm, count, room)?;
            match output {
                OwnedOutput::ToServos => self.send_to_servos(arm)?,
                OwnedOutput::ToHost => self.send_to_host(arm, room)?,
                OwnedOutput::Vacuum(vacuum) => {
                    self.log.event(self.now, format!("{vacuum:?}"));
                    arm.status_checker.vacuum_switched(self.now, vacuum)?;
                }
                OwnedOutput::Save(image) => {
                    if !self.save(arm, image)? {
                        return Ok(false);
                    }
                }
                OwnedOutput::Wait(until) => return self.wait(arm, until, room).map(|()| true),
            }
        }
        Err(Violation(format!("{MAX_OUTPUTS} outputs without a wait")))
    }

    fn send_to_servos(&mut self, arm: &mut PoweredArm) -> Check {
        let PoweredArm { controller, model, command_checker, output_bytes: bytes, .. } = arm;
        self.log.bus(self.now, "to servos", bytes);
        let registers = controller.registers();
        command_checker.check(bytes, &CommandContext { now: self.now, registers, model, bus: &self.bus })?;
        self.bus.send(self.now, bytes, &mut self.rng);
        Ok(())
    }

    fn send_to_host(&mut self, arm: &mut PoweredArm, room: usize) -> Check {
        let effect = arm.owed.take();
        let bytes = arm.output_bytes.as_slice();
        self.log.host(self.now, "arm", bytes);
        ensure(bytes.len() <= room, || format!("{} bytes to the host with room for {room}", bytes.len()))?;
        arm.to_host.push(bytes.len());
        let registers = arm.controller.registers();
        let expected = match effect {
            Some(RequestEffect::Reply { address, count }) => {
                self.counts.replies += 1;
                reply(address, registers.read(address, count))
            }
            Some(RequestEffect::Alarm { kind }) => {
                self.counts.alarms += 1;
                alarm(kind)
            }
            Some(RequestEffect::Save(_)) => return Err(Violation(format!("a reply to {effect:?}"))),
            None | Some(RequestEffect::NoReply { .. }) => {
                self.counts.reports += 1;
                let stream = ReportStream::of(bytes);
                arm.status_checker.reports.sent(self.now, stream)?;
                let (function, address, count) = stream.frame(arm.model.report_content());
                report(function, address, registers.read(address, count))
            }
        };
        if extended_model::shows_block(&expected) {
            arm.model.compare_fine_targets(arm.controller.registers())?;
            let PoweredArm { let_go_rule, controller, model, command_checker, .. } = &mut *arm;
            let keeps_target = |joint| command_checker.keeps_target(joint);
            let_go_rule.check(controller.registers(), &model.target_writes, keeps_target)?;
            arm.check_status(self.now, &self.bus, |checker, context| checker.check_fine_positions(context))?;
        }
        ensure(arm.output_bytes == expected, || format!("the frame to the host should be {expected:02x?}"))
    }

    /// Saves settings. Returns true if the power is still on.
    fn save(&mut self, arm: &mut PoweredArm, image: Image) -> Check<bool> {
        let effect = arm.owed.take();
        let is_expected = effect == Some(RequestEffect::Save(image));
        ensure(is_expected, || format!("{image:?} is saved after {effect:?}"))?;
        self.counts.saves += 1;
        let cut = std::mem::take(&mut arm.cuts_next_save).then(|| random_cut(8, &mut self.rng));
        self.log.event(self.now, format!("save {:02x?}, cut {cut:?}", image.0));
        match self.storage.save(&image, cut)? {
            PowerOutcome::Cut => {
                self.counts.cut_saves += 1;
                Ok(false)
            }
            PowerOutcome::Completed(storage) => {
                self.log.event(self.now, format!("storage {storage:?}"));
                arm.controller.set_storage(storage);
                arm.model.set_storage(storage);
                Ok(true)
            }
        }
    }

    fn wait(&mut self, arm: &mut PoweredArm, until: Instant, room: usize) -> Check {
        let is_done = matches!(arm.owed, None | Some(RequestEffect::NoReply { .. }));
        ensure(is_done || until <= self.now, || format!("the arm waits and owes {:?}", arm.owed))?;
        let has_room = room >= MAX_LENGTH;
        if !has_room {
            arm.status_checker.reports.disturb();
        }
        if !arm.to_arm.waiting().is_empty() {
            // The controller did not take these bytes, for lack of room. The time of its wait does not depend on them.
        } else if until > self.now {
            arm.expired_waits = 0;
            arm.check_pending(self.now, room)?;
        } else {
            arm.expired_waits += 1;
            ensure(arm.expired_waits < MAX_EXPIRED_WAITS, || {
                format!("{MAX_EXPIRED_WAITS} waits in a row until {} us, which has passed", until.as_micros())
            })?;
        }
        let room_at = if has_room { Instant::FAR_FUTURE } else { arm.to_host.room_at(self.now) };
        let delay = self.rng.between(Duration::ZERO, self.parameters.jitter);
        arm.wake_at = until.max(self.now).min(room_at) + delay;
        Ok(())
    }
}

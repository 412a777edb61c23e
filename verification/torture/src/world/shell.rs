//! The shell round the controller: one turn of its loop, and a check of everything that comes out.

use motion_core::{Output, Vacuum};
use protocol_core::registers::map::{
    FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED,
    VACUUM_PUMP,
};
use protocol_core::registers::{Image, Joint, Register};
use protocol_core::time::Instant;

use super::asked::{Asked, answer};
use super::audit::{Audit, Sight, concerns_motion};
use super::commands::Circumstances;
use super::model::Effect;
use super::power::any_cut;
use super::servos::Servos;
use super::settings::End;
use super::{Life, MOST_OUTPUTS, World};
use crate::violation::{Check, Violation, ensure};

/// An output, free of the controller that made it: the bytes are in [`Life::said`].
enum Said {
    ToHost,
    ToServos,
    Vacuum(Vacuum),
    Save(Image),
    Wait(Instant),
}

impl Life {
    fn poll(&mut self, now: Instant, room: usize) -> Said {
        let Self { controller, said, .. } = self;
        let mut keep = |bytes: &[u8], what| {
            said.clear();
            said.extend_from_slice(bytes);
            what
        };
        match controller.poll(now, room) {
            Output::ToHost(bytes) => keep(bytes, Said::ToHost),
            Output::ToServos(bytes) => keep(bytes, Said::ToServos),
            Output::Vacuum(vacuum) => Said::Vacuum(vacuum),
            Output::Save(image) => Said::Save(image),
            Output::Wait(until) => Said::Wait(until),
        }
    }

    /// How many frames the controller has counted, taken or refused.
    fn counted(&self) -> u16 {
        let registers = self.controller.registers();
        let count = |at: u8| u16::from_le_bytes([registers.get(at), registers.get(at + 1)]);
        count(FRAMES_ACCEPTED.address).wrapping_add(count(FRAMES_REFUSED.address))
    }

    /// Lets the audit look at all else.
    pub(super) fn audited<T>(
        &mut self,
        now: Instant,
        servos: &Servos,
        look: impl FnOnce(&mut Audit, &Sight<'_>) -> T,
    ) -> T {
        let Self { controller, model, commands, audit, .. } = self;
        look(audit, &Sight { now, arm: controller.registers(), model, servos, commands })
    }

    /// Hands over what waits, or says that nothing does. Says whether it was any.
    fn hand_over(&mut self, now: Instant) -> bool {
        let taken = self.controller.host_bytes(now, self.to_arm.waiting());
        if taken > 0 {
            self.to_arm.take(now, taken);
        }
        taken > 0
    }
}

impl World {
    /// One turn. Says whether the power is still on at its end.
    pub(super) fn turn(&mut self, life: &mut Life) -> Check<bool> {
        let said = self.servos.say(self.now, &mut self.dice);
        if !said.is_empty() {
            self.notes.bus(self.now, "from servos", &said);
            life.commands.answered(&said);
            life.controller.servo_bytes(self.now, &said);
        }
        while life.hand_over(self.now) {
            if !self.poll(life)? {
                return Ok(false);
            }
        }
        self.poll(life)
    }

    /// Carries out what the controller wants until it wants to wait.
    fn poll(&mut self, life: &mut Life) -> Check<bool> {
        for _ in 0..MOST_OUTPUTS {
            if self.traits.receives_before_every_poll {
                life.hand_over(self.now);
            }
            let room = life.to_host.room(self.now);
            let before = life.counted();
            let said = life.poll(self.now, room);
            let count = life.counted().wrapping_sub(before);
            let effect = self.follow(life, count)?;
            match said {
                Said::ToServos => self.tell_servos(life)?,
                Said::ToHost => self.tell_host(life, effect, room)?,
                Said::Vacuum(vacuum) => {
                    self.notes.event(self.now, format!("{vacuum:?}"));
                    life.audit.vacuum(self.now, vacuum)?;
                }
                Said::Save(image) => {
                    if !self.save(life, image, effect)? {
                        return Ok(false);
                    }
                }
                Said::Wait(until) => return self.wait(life, until, room).map(|()| true),
            }
        }
        Err(Violation(format!("{MOST_OUTPUTS} outputs, and no wait")))
    }

    /// Follows the controller through the requests it has counted; the effect of the last.
    fn follow(&mut self, life: &mut Life, count: u16) -> Check<Option<Effect>> {
        self.note_missing(life);
        let mut last = None;
        for _ in 0..count {
            let came = life.pending.front().is_some_and(|first| first.arrived <= self.now);
            let next = life.pending.pop_front().filter(|_| came);
            let next =
                next.ok_or_else(|| Violation("a request was carried out that nobody sent".to_owned()))?;
            let is_quiet = matches!(last, None | Some(Effect::Silence { .. }));
            ensure(is_quiet, || format!("{last:?} did not come out before {:?}", next.asked))?;
            let was_servo = life.model.is_servo();
            let effect = life.model.take(&next.asked);
            if life.model.is_servo() != was_servo {
                Joint::ALL.into_iter().for_each(|joint| life.commands.forget(joint));
            }
            if !life.model.is_servo() {
                self.servos.state_is_off(self.now);
            }
            self.written(life, &next.asked, effect);
            last = Some(effect);
        }
        if count > 0 {
            life.model.compare(life.controller.registers())?;
        }
        life.model.compare_targets(life.controller.registers())?;
        Ok(last)
    }

    fn note_missing(&mut self, life: &mut Life) {
        let Some((gone, back)) = life.audit.missing_changed(life.controller.registers()) else { return };
        self.notes.event(self.now, format!("missing: {gone:#b} more, {back:#b} less"));
        for joint in Joint::ALL {
            if gone & joint.bit() != 0 {
                life.model.aimed[joint] = false;
                life.commands.falls_silent(joint);
            }
        }
        if back != 0 {
            life.audited(self.now, &self.servos, Audit::motion_changed);
        }
    }

    /// What has to be noted about a write that was accepted.
    fn written(&self, life: &mut Life, asked: &Asked, effect: Effect) {
        let Asked::Write { address, values } = asked else { return };
        if effect == (Effect::Silence { accepted: false }) {
            return;
        }
        let reaches =
            |at: u8| at.checked_sub(*address).is_some_and(|offset| usize::from(offset) < values.len());
        let reaches_any = |row: &Register| (row.address..row.address + row.count).any(reaches);
        if reaches(FEEDBACK_FREQUENCY.address) {
            let (frequency, baud) = (life.model.frequency(), life.controller.baud());
            life.audit.frequency_written(self.now, frequency, baud);
        }
        if reaches(VACUUM_PUMP.address) {
            life.audit.vacuum_written(self.now);
        }
        if reaches(MOTOR_STATE.address) {
            life.audit.state_written(self.now);
        }
        if reaches_any(&SPEED) {
            life.commands.speed_written(&life.model);
        }
        if reaches_any(&OFFSET) && matches!(effect, Effect::Save(_)) {
            life.commands.places_are_renamed();
            life.audit.places_are_renamed(self.now);
        }
        if concerns_motion(*address, values.len()) {
            life.audited(self.now, &self.servos, Audit::motion_changed);
        }
    }

    fn tell_servos(&mut self, life: &mut Life) -> Check {
        let Life { controller, model, commands, said: bytes, .. } = life;
        self.notes.bus(self.now, "to servos", bytes);
        let arm = controller.registers();
        commands.judge(bytes, &Circumstances { now: self.now, arm, model, servos: &self.servos })?;
        self.servos.hear(self.now, bytes, &mut self.dice);
        Ok(())
    }

    fn tell_host(&mut self, life: &mut Life, effect: Option<Effect>, room: usize) -> Check {
        let bytes = life.said.as_slice();
        self.notes.host(self.now, "arm", bytes);
        ensure(bytes.len() <= room, || format!("{} bytes for a room of {room}", bytes.len()))?;
        life.to_host.push(bytes.len());
        let (address, count) = match effect {
            Some(Effect::Answer { address, count }) => {
                self.tally.answers += 1;
                (address, count)
            }
            Some(Effect::Save(_)) => return Err(Violation(format!("an answer to {effect:?}"))),
            None | Some(Effect::Silence { .. }) => {
                self.tally.reports += 1;
                life.audit.report(self.now)?;
                (PRESENT_POSITION.address, PRESENT_POSITION.count)
            }
        };
        let wanted = answer(address, life.controller.registers().read(address, count));
        ensure(life.said == wanted, || format!("{wanted:02x?} was to be said"))
    }

    /// Saves settings. Says whether the power is still on.
    fn save(&mut self, life: &mut Life, image: Image, effect: Option<Effect>) -> Check<bool> {
        ensure(effect == Some(Effect::Save(image)), || format!("{image:?} is saved after {effect:?}"))?;
        self.tally.saves += 1;
        let cut = std::mem::take(&mut life.save_is_cut).then(|| any_cut(8, &mut self.dice));
        self.notes.event(self.now, format!("save {:02x?}, cut {cut:?}", image.0));
        match self.settings.save(&image, cut)? {
            End::Cut => {
                self.tally.cut_saves += 1;
                Ok(false)
            }
            End::Done(storage) => {
                self.notes.event(self.now, format!("storage {storage:?}"));
                life.controller.set_storage(storage);
                life.model.set_storage(storage);
                Ok(true)
            }
        }
    }

    fn wait(&mut self, life: &mut Life, until: Instant, room: usize) -> Check {
        let has_room = room >= super::asked::LONGEST;
        if !has_room {
            life.audit.link_is_busy();
        }
        if !life.to_arm.waiting().is_empty() {
            // Something waits, and the controller knows of it.
        } else if until > self.now {
            life.hasty_waits = 0;
            self.check_pending(life, room)?;
        } else {
            life.hasty_waits += 1;
            ensure(life.hasty_waits < 4, || {
                format!("again and again a wait until {} us", until.as_micros())
            })?;
        }
        let room_at = if has_room { Instant::FAR_FUTURE } else { life.to_host.room_at(self.now) };
        let late = self.dice.between(protocol_core::time::Duration::ZERO, self.traits.jitter);
        life.due = until.max(self.now).min(room_at) + late;
        Ok(())
    }
}

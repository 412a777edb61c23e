//! Applies the requests that the controller has executed to the models, and tells the checkers.

use motion_core::calibration::angle_from_counts;
use protocol_core::registers::map::{MOTOR_STATE, OFFSET, SPEED, TARGET_POSITION, VACUUM_PUMP, motor_state};
use protocol_core::registers::{Joint, Register};

use super::extended_model::{self, WATCHDOG, WATCHDOG_ACTION};
use super::host_request::HostRequest;
use super::protection_model::SUPPLY_LOST;
use super::register_model::limits::FoundVerdicts;
use super::register_model::{OwnTarget, RequestEffect};
use super::state::{PoweredArm, TortureWorld};
use super::status_checker::{StatusChecker, affects_motion};
use crate::violation::{Check, Violation, ensure};

impl PoweredArm {
    /// Finds which of the next `count` requests the arm refused against a limit where the model cannot know it (D25).
    fn find_verdicts(&self, count: u16, room: usize) -> FoundVerdicts {
        let requests: Vec<_> =
            self.pending.iter().take(count.into()).map(|pending| &pending.request).collect();
        if !self.model.may_limit(&requests) {
            return FoundVerdicts::default();
        }
        self.model.find_verdicts(&requests, room, self.controller.registers())
    }
}

impl TortureWorld {
    /// Applies the next `count` requests to the model. `room` is the free space of the link, in bytes. `owed` then holds
    /// the effect of the last request; frames to the servos may come before its output. Compares the model with the arm's
    /// registers: after requests all that the model knows, otherwise only the targets.
    pub(super) fn apply_requests(&mut self, arm: &mut PoweredArm, count: u16, room: usize) -> Check {
        self.record_missing(arm);
        self.record_lost_supply(arm)?;
        self.allow_own_targets(arm);
        let verdicts = arm.find_verdicts(count, room);
        let mut outcomes = verdicts.outcomes.into_iter();
        let mut last = arm.owed.take();
        for _ in 0..count {
            let has_arrived = arm.pending.front().is_some_and(|first| first.arrived_at <= self.now);
            let request = arm.pending.pop_front().filter(|_| has_arrived).map(|pending| pending.request);
            let request = request
                .ok_or_else(|| Violation("a request was executed that the host did not send".to_owned()))?;
            let has_output = !matches!(last, None | Some(RequestEffect::NoReply { .. }));
            ensure(!has_output, || format!("the output of {last:?} is missing before {request:?}"))?;
            arm.model.told = outcomes.next();
            // In a poll, the controller executes writes before the watchdog acts, and a read after it.
            if request.is_read() {
                self.let_watchdog_act(arm);
            }
            last = Some(self.apply_request(arm, &request, room));
        }
        for joint in Joint::ALL.into_iter().filter(|joint| verdicts.unclear & joint.bit() != 0) {
            arm.model.targets[joint] = None;
        }
        self.let_watchdog_act(arm);
        let registers = arm.controller.registers();
        arm.watchdog.check_fault(registers)?;
        if count > 0 {
            arm.model.compare(registers)?;
        }
        arm.model.compare_targets(registers)?;
        arm.owed = last;
        Ok(())
    }

    fn apply_request(&mut self, arm: &mut PoweredArm, request: &HostRequest, room: usize) -> RequestEffect {
        let was_servo = arm.model.is_servo();
        let writes = arm.model.target_writes;
        let effect = arm.model.execute(request, room);
        for joint in Joint::ALL.into_iter().filter(|joint| arm.model.target_writes[*joint] != writes[*joint])
        {
            let may_be_let_go = self.bus.may_be_let_go(joint, self.now);
            arm.command_checker.target_written(self.now, joint, may_be_let_go);
        }
        if request.is_well_formed() {
            arm.watchdog.heard(self.now);
        }
        if arm.model.is_servo() != was_servo {
            arm.command_checker.state_changed();
        }
        if !arm.model.is_servo() {
            self.bus.exempt_all_by_state(self.now);
        }
        self.record_write(arm, request, effect);
        effect
    }

    fn record_missing(&mut self, arm: &mut PoweredArm) {
        let Some((lost, found)) = arm.status_checker.missing_changed(arm.controller.registers()) else {
            return;
        };
        self.log.event(self.now, format!("servos lost: {lost:#b}, found: {found:#b}"));
        for joint in Joint::ALL {
            if lost & joint.bit() != 0 {
                arm.model.forget_target(joint);
                arm.command_checker.servo_lost(self.now, joint);
            }
        }
        if found != 0 {
            arm.check_status(self.now, &self.bus, StatusChecker::motion_changed);
        }
    }

    /// Tells the model which targets the arm may set itself: a servo held a goal at the start (D12), or a joint gives way
    /// (D27) or is let go (D28).
    fn allow_own_targets(&self, arm: &mut PoweredArm) {
        for joint in Joint::ALL {
            let held_goal = arm.command_checker.held_goal(joint);
            let own_target = self.own_target(arm, joint);
            arm.model.held_targets[joint] = held_goal.map(|counts| degrees(arm, joint, counts));
            arm.model.own_targets[joint] = own_target;
        }
    }

    fn own_target(&self, arm: &PoweredArm, joint: Joint) -> OwnTarget {
        if !arm.model.is_servo() {
            return OwnTarget::Measured;
        }
        let gives_way = self.bus.truth(joint).may_give_way(self.now);
        match gives_way.then(|| arm.command_checker.goal(joint)).flatten() {
            Some(counts) => {
                let (goal, present) =
                    (degrees(arm, joint, counts), degrees(arm, joint, self.bus.position(joint)));
                let (low, high) = (goal.min(present).saturating_sub(2), goal.max(present) + 2);
                // A set-point may lie beyond the end of the servo's range.
                let (low, high) = if matches!(counts, 0 | 1_023) { (0, 180) } else { (low, high) };
                OwnTarget::GaveWay { low, high, before: arm.model.get(TARGET_POSITION.of(joint)) }
            }
            None if self.bus.may_be_let_go(joint, self.now) => {
                OwnTarget::Before(arm.model.get(TARGET_POSITION.of(joint)))
            }
            None => OwnTarget::Measured,
        }
    }

    /// If the arm has entered state 0 because the supply of its servos was lost (D29), the model takes over the effect.
    fn record_lost_supply(&mut self, arm: &mut PoweredArm) -> Check {
        let is_told = arm.controller.registers().get(SUPPLY_LOST) == 1;
        if !is_told || arm.model.get(SUPPLY_LOST) == 1 {
            return Ok(());
        }
        self.log.event(self.now, "the arm has lost its supply".to_owned());
        arm.command_checker.check_lost_supply(self.now, &self.bus)?;
        arm.model.lose_supply();
        self.record_damping(arm);
        Ok(())
    }

    /// Tells the checkers that the arm has entered state 0 by itself.
    fn record_damping(&mut self, arm: &mut PoweredArm) {
        arm.status_checker.state_written(self.now);
        arm.command_checker.state_changed();
        self.bus.exempt_all_by_state(self.now);
    }

    /// If the watchdog may have acted in this poll (D24), the model takes over its effect.
    fn let_watchdog_act(&mut self, arm: &mut PoweredArm) {
        if !arm.watchdog.may_act(self.now) {
            return;
        }
        let registers = arm.controller.registers();
        if arm.model.get(WATCHDOG_ACTION) == 0 {
            for joint in Joint::ALL {
                arm.model.take_target(joint, registers.get(TARGET_POSITION.of(joint)));
            }
        } else if registers.get(MOTOR_STATE.address) == motor_state::DAMPING
            && arm.model.get(MOTOR_STATE.address) != motor_state::DAMPING
        {
            self.log.event(self.now, "the watchdog damps the arm".to_owned());
            arm.model.damp();
            self.record_damping(arm);
            // The arm is in state 0 already, so the end of an emergency stop has no effect that could be checked.
            self.supply_rule.forget();
        }
    }

    /// Tells the checkers about an accepted write.
    fn record_write(&mut self, arm: &mut PoweredArm, request: &HostRequest, effect: RequestEffect) {
        let (HostRequest::Write { address, values } | HostRequest::WriteMap21 { address, values }) = request
        else {
            return;
        };
        if matches!(effect, RequestEffect::NoReply { accepted: false } | RequestEffect::Alarm { .. }) {
            return;
        }
        let includes = |at: u8| extended_model::covers(*address, values.len(), at);
        let includes_any = |row: &Register| (row.address..row.address + row.count).any(includes);
        let (frequencies, baud) = (arm.model.frequencies(), arm.controller.baud());
        arm.status_checker.reports.frequencies_written(
            self.now,
            frequencies,
            arm.model.report_content(),
            baud,
        );
        if includes(WATCHDOG) && matches!(request, HostRequest::Write { .. }) {
            arm.watchdog.set(self.now, arm.model.get(WATCHDOG));
        }
        if includes(VACUUM_PUMP.address) {
            arm.status_checker.vacuum_written(self.now);
        }
        if includes(MOTOR_STATE.address) {
            arm.status_checker.state_written(self.now);
            arm.command_checker.state_written();
            self.supply_rule.forget();
        }
        if includes_any(&SPEED) {
            arm.command_checker.speed_written(&arm.model);
        }
        if includes_any(&OFFSET) && matches!(effect, RequestEffect::Save(_)) {
            arm.command_checker.offsets_changed(self.now);
            arm.status_checker.offsets_changed(self.now);
        }
        if affects_motion(*address, values.len()) {
            arm.check_status(self.now, &self.bus, StatusChecker::motion_changed);
        }
    }
}

/// The angle of a joint in whole degrees, with its offset.
fn degrees(arm: &PoweredArm, joint: Joint, counts: u16) -> u8 {
    angle_from_counts(joint, counts, arm.model.offset(joint)).nearest_degree()
}

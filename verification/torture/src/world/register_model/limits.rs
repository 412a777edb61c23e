//! The verdict of the limits on a write (D25). A verdict that the model cannot know follows from the arm's registers.

use protocol_core::registers::map::{MOTOR_STATE, limit, motor_state};
use protocol_core::registers::{Joint, RegisterFile};

use super::super::extended_model::{self, LIMITS};
use super::super::host_request::HostRequest;
use super::super::limit_verdict::{self, CLAW, LINKAGE, LimitVerdict};
use super::super::written_targets::WrittenTargets;
use super::RegisterModel;

/// The largest number of combinations of unknown verdicts that are tried for the requests of one poll.
const MAX_TRIALS: usize = 1_024;

/// The verdicts of the arm on the requests of a poll, as far as its registers tell them.
#[derive(Debug, Default)]
pub(crate) struct FoundVerdicts {
    /// For each request, the register that the refusal names; `None` if the limits allowed the request.
    pub(crate) outcomes: Vec<Option<u8>>,
    /// The joints whose targets remain unknown, bit n-1 for joint n.
    pub(crate) unclear: u8,
}

impl RegisterModel {
    /// The possible outcomes of a write: the register that a refusal names; `None` if the limits allow the write.
    pub(crate) fn limit_outcomes(&self, write: &WrittenTargets<'_>) -> Vec<Option<u8>> {
        let before = self.get(LIMITS);
        let after = write.value_at(LIMITS).unwrap_or(before);
        let enters_servo =
            !self.is_servo() && write.value_at(MOTOR_STATE.address) == Some(motor_state::SERVO);
        let known = |joint| write.of(joint).or(self.targets[joint].filter(|_| !enters_servo));
        let [_, two, three, .., seven] = Joint::ALL;
        let sum = known(two).zip(known(three)).map(|(two, three)| two.0 + three.0);
        let linkage = sum.map(|sum| LINKAGE.0 <= sum && sum <= LINKAGE.1);
        let claw = known(seven).map(|angle| angle.0 <= CLAW);
        let of = |bit: u8, joints: &[Joint], is_kept: Option<bool>| {
            let is_switched_on = before & bit == 0;
            let at = if is_switched_on { Some(LIMITS) } else { write.first_register(joints) };
            let Some(at) = at.filter(|_| after & bit != 0) else { return LimitVerdict::Allowed };
            match is_kept {
                Some(false) => LimitVerdict::Refused(at),
                // A set-point may break the limit.
                Some(true) if is_switched_on && self.is_servo() => LimitVerdict::Unknown(at),
                Some(true) => LimitVerdict::Allowed,
                None => LimitVerdict::Unknown(at),
            }
        };
        limit_verdict::outcomes([of(limit::LINKAGE, &[two, three], linkage), of(limit::CLAW, &[seven], claw)])
    }

    /// Finds which of the requests of a poll the arm refused against a limit, where the model cannot know it. Tries the
    /// combinations, at most [`MAX_TRIALS`], and keeps those that lead to the arm's registers.
    pub(crate) fn find_verdicts(
        &self,
        requests: &[&HostRequest],
        room: usize,
        registers: &RegisterFile,
    ) -> FoundVerdicts {
        let mut trials = vec![(self.clone(), Vec::<Option<u8>>::new())];
        for request in requests {
            let mut next = Vec::new();
            for (before, outcomes) in trials {
                let mut any = Self { told: None, ..before.clone() };
                any.execute(request, room);
                for outcome in any.outcomes {
                    let mut model = Self { told: Some(outcome), ..before.clone() };
                    model.execute(request, room);
                    next.push((model, [outcomes.as_slice(), &[outcome]].concat()));
                }
            }
            next.truncate(MAX_TRIALS);
            trials = next;
        }
        trials.retain(|(model, _)| model.fits(registers));
        let Some((first, outcomes)) = trials.first() else { return FoundVerdicts::default() };
        let differs =
            |joint: &Joint| trials.iter().any(|(other, _)| other.targets[*joint] != first.targets[*joint]);
        let unclear = Joint::ALL.into_iter().filter(differs).fold(0, |bits, joint| bits | joint.bit());
        FoundVerdicts { outcomes: outcomes.clone(), unclear }
    }

    /// True if any of the requests may be against a limit.
    pub(crate) fn may_limit(&self, requests: &[&HostRequest]) -> bool {
        let switches_on = |request: &&HostRequest| match request {
            HostRequest::Write { address, values } => extended_model::covers(*address, values.len(), LIMITS),
            _ => false,
        };
        self.get(LIMITS) != 0 || requests.iter().any(switches_on)
    }
}

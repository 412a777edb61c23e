//! Alarms and emergency stops in the matrix of poses and payloads, while a joint is driven. Measures how far a joint falls
//! without torque, and how far its motor turns it after the torque comes back.

use arm_sim::plant::SupplyFault;
use arm_sim::servo::Trip;
use protocol_core::registers::Joint;
use protocol_core::time::Duration;

use super::arm::{ObstacleArm, degrees};
use super::mishap::{Mishap, seconds};
use super::wall::WallCase;

/// The joint is driven for this time. No target is sent afterwards, so a later motion is the effect of windup.
const DRIVEN_TIME: Duration = Duration::from_millis(400);
/// The time of the measurement after an alarm, or after the supply came back.
const AFTER_TIME: Duration = Duration::from_millis(6_000);

/// How far a joint fell without torque (`fall`), and how far it turned after the torque came back (`swing`). Angles are in
/// thousandths of a degree.
#[derive(Clone, Copy, Debug)]
struct Fate {
    begun: i32,
    /// The angle at which the joint got torque again.
    engaged: Option<i32>,
    was_lost: bool,
    fall: u32,
    swing: u32,
}

impl Fate {
    const fn at(begun: i32) -> Self {
        Self { begun, engaged: None, was_lost: false, fall: 0, swing: 0 }
    }

    fn observe(&mut self, angle: i32, has_torque: bool) {
        if !has_torque {
            (self.was_lost, self.engaged) = (true, None);
            self.fall = self.fall.max(angle.abs_diff(self.begun));
        } else if self.was_lost {
            let engaged = *self.engaged.get_or_insert(angle);
            self.swing = self.swing.max(angle.abs_diff(engaged));
        }
    }
}

/// The largest fall and swing of any joint in some cases. `hold` counts the cases after which all watched
/// joints have torque.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    cases: u32,
    fall: u32,
    swing: u32,
    hold: u32,
}

impl Worst {
    fn add(&mut self, fates: &[Fate]) {
        self.cases += 1;
        self.hold += u32::from(fates.iter().all(|fate| fate.engaged.is_some() || !fate.was_lost));
        for fate in fates {
            (self.fall, self.swing) = (self.fall.max(fate.fall), self.swing.max(fate.swing));
        }
    }

    fn cells(&self) -> String {
        format!("{} | {} | {} | {}", self.cases, degrees(self.fall), degrees(self.swing), self.hold)
    }
}

/// The tables of the worst results: alarms by joint, and emergency stops by payload.
pub(super) fn tables<A: ObstacleArm>(cases: &[WallCase]) -> Result<String, A::Error> {
    let head = "cases | a joint falls by | then its motor turns it by | all hold after it |\n\
                | --- | --- | --- | --: | --: | --: | --: |\n";
    let mut text = format!("| alarm | of joint | protection | {head}");
    for (trip, name) in [(Trip::Overload, "overload"), (Trip::Heat, "heat")] {
        for (joint, is_protected) in
            Joint::ALL.into_iter().take(6).flat_map(|joint| [(joint, false), (joint, true)])
        {
            let cases = cases.iter().filter(|case| case.joint() == joint);
            let worst = worst::<A>(cases, Mishap::Trip(trip), is_protected)?;
            text += &format!("| {name} | {} | {} | {} |\n", joint.number(), on(is_protected), worst.cells());
        }
    }
    text += &format!("\n| supply off for | payload | protection | {head}");
    for millis in [300, 3_000, 30_000] {
        for (grams, is_protected) in
            WallCase::PAYLOADS_G.into_iter().flat_map(|grams| [(grams, false), (grams, true)])
        {
            let cases = cases.iter().filter(|case| case.payload_g() == grams && case.is_of_its_pose());
            let worst = worst::<A>(cases, Mishap::EmergencyStop(millis), is_protected)?;
            let (time, protection) = (seconds(millis), on(is_protected));
            text += &format!("| {time} | {grams} g | {protection} | {} |\n", worst.cells());
        }
    }
    Ok(text)
}

const fn on(is_protected: bool) -> &'static str {
    if is_protected { "on" } else { "off" }
}

fn worst<'a, A: ObstacleArm>(
    cases: impl Iterator<Item = &'a WallCase>,
    mishap: Mishap,
    is_protected: bool,
) -> Result<Worst, A::Error> {
    let mut worst = Worst::default();
    for case in cases {
        worst.add(&fates::<A>(case, mishap, is_protected)?);
    }
    Ok(worst)
}

/// Runs a case with a mishap. Returns the fate of the joint with the alarm, or of all joints after an emergency stop.
fn fates<A: ObstacleArm>(case: &WallCase, mishap: Mishap, is_protected: bool) -> Result<Vec<Fate>, A::Error> {
    let mut arm: A = case.start(is_protected)?;
    case.drive_for(&mut arm, DRIVEN_TIME)?;
    let joints = match mishap {
        Mishap::Trip(_) => vec![case.joint()],
        Mishap::EmergencyStop(_) => Joint::ALL.to_vec(),
    };
    let mut fates: Vec<_> = joints.iter().map(|joint| Fate::at(arm.plant().angle(*joint))).collect();
    let mut watch = |arm: &mut A, time: Duration| -> Result<(), A::Error> {
        let end = arm.now() + time;
        while arm.now() < end {
            arm.step()?;
            for (fate, joint) in fates.iter_mut().zip(&joints) {
                fate.observe(arm.plant().angle(*joint), arm.plant().has_torque(*joint));
            }
        }
        Ok(())
    };
    match mishap {
        Mishap::Trip(trip) => arm.plant().trip(case.joint(), trip),
        Mishap::EmergencyStop(millis) => {
            arm.plant().set_supply_fault(Some(SupplyFault::Off));
            watch(&mut arm, Duration::from_millis(millis))?;
            arm.plant().set_supply_fault(None);
        }
    }
    watch(&mut arm, AFTER_TIME)?;
    Ok(fates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacles::simulated::SimulatedObstacleArm;

    #[test]
    fn d28_d29_no_motor_turns_a_joint_far_when_it_has_torque_again() {
        let cases = WallCase::all();
        let case = cases.iter().find(|case| case.joint() == Joint::ALL[2] && case.payload_g() == 100);
        let case = case.expect("a case of joint 3");
        for mishap in [Mishap::Trip(Trip::Overload), Mishap::EmergencyStop(300)] {
            let Ok(fates) = fates::<SimulatedObstacleArm>(case, mishap, true);
            assert!(
                fates.iter().all(|fate| fate.was_lost && fate.engaged.is_some()),
                "{mishap:?}: {fates:?}"
            );
            assert!(fates.iter().all(|fate| fate.swing < 5_000), "{mishap:?}: {fates:?}");
        }
    }
}

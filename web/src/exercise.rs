//! What the arm measures, for an exercise.

use arm_sim::world::{Object, World};
use exercises::{Observation, SeenThing};
use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::map::BLOCKED_JOINTS;

use crate::arm_state::ArmState;
use crate::stop::since_start;

/// What these registers of the arm say at `now`, and what is in its room.
#[must_use]
pub fn observation(now: Instant, registers: &Snapshot, world: Option<&World>) -> Observation {
    let state = ArmState::new(registers);
    Observation {
        seconds: since_start(now).as_secs_f64(),
        tip: state.tip(),
        joints: state.answered().map(|angle| angle.map(f64::from)),
        blocked: registers.byte(&BLOCKED_JOINTS),
        things: world.map(seen_things).unwrap_or_default(),
    }
}

fn seen_things(world: &World) -> Vec<SeenThing> {
    let seen = |object: &Object| {
        let at = object.frame.origin;
        SeenThing { name: object.item.name.clone(), at: [at.x, at.y, at.z], is_carried: object.is_carried }
    };
    world.objects().iter().map(seen).collect()
}

#[cfg(test)]
mod tests {
    use exercises::{Attempt, SolutionPart, shipped};

    use crate::program::ProgramProgress;
    use crate::tab::Tab;

    /// Runs the solution of an exercise, and says what each part of it came to.
    fn solve(tab: &mut Tab, attempt: &mut Attempt, parts: &[SolutionPart]) -> Vec<ProgramProgress> {
        let mut ends = Vec::new();
        for part in parts {
            match part {
                SolutionPart::Repair => tab.act("clear"),
                SolutionPart::Program(program) => {
                    let watch = |_, tab: &mut Tab| {
                        attempt.observe(&tab.observation());
                    };
                    ends.push(tab.run(program, watch).0);
                    // The hold after a failed program is confirmed.
                    tab.pass(60);
                }
            }
        }
        ends
    }

    #[test]
    fn the_solution_of_each_shipped_exercise_reaches_all_of_its_goals() {
        for exercise in shipped() {
            let title = exercise.title.of("en");
            let (mut tab, mut attempt) = (Tab::new(), Attempt::new(&exercise));
            exercise.setup.iter().for_each(|action| tab.act(action));
            let ends = solve(&mut tab, &mut attempt, &exercise.solution());
            assert_eq!(ends.last(), Some(&ProgramProgress::Over), "{title}: {ends:?}");
            let reached: Vec<_> = attempt.reached().collect();
            assert!(attempt.is_solved(), "{title}: {reached:?}");
        }
    }

    #[test]
    fn a_silent_joint_is_nowhere() {
        let mut tab = Tab::new();
        let seen = |tab: &Tab| tab.observation();
        assert!(seen(&tab).tip.is_some() && seen(&tab).joints[2].is_some());
        tab.act("fault 3=missing");
        tab.pass(60);
        let seen = seen(&tab);
        assert!(seen.tip.is_none() && seen.joints[2].is_none() && seen.joints[0].is_some(), "{seen:?}");
    }

    #[test]
    fn an_arm_that_stays_reaches_nothing() {
        for exercise in shipped() {
            let (mut tab, mut attempt) = (Tab::new(), Attempt::new(&exercise));
            for _ in 0..200 {
                tab.pass(1);
                attempt.observe(&tab.observation());
            }
            assert!(attempt.reached().all(|is_reached| !is_reached), "{}", exercise.title.of("en"));
        }
    }
}

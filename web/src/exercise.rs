//! Connects an exercise with the arm: makes its observations, and sets up the simulated arm.

use arm_sim::Action;
use arm_sim::scene::Scene;
use arm_sim::world::{Object, World};
use exercises::{SeenThing, Situation};
use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::map::BLOCKED_JOINTS;

use crate::arm_state::ArmState;
use crate::source::simulator::SimulatedSource;
use crate::stop::since_start;

/// The situation, from the registers at `now` and, for a simulated arm, from the things in its room.
#[must_use]
pub fn situation(now: Instant, registers: &Snapshot, world: Option<&World>) -> Situation {
    let state = ArmState::new(registers);
    Situation {
        seconds: since_start(now).as_secs_f64(),
        tip: state.tip(),
        joints: state.answered().map(|angle| angle.map(f64::from)),
        blocked: registers.byte(&BLOCKED_JOINTS),
        things: world.map(seen_things).unwrap_or_default(),
    }
}

/// Sets up a simulated arm for an exercise: removes all obstacles, faults and things, then carries out the exercise's actions.
pub fn set_up(arm: &mut SimulatedSource, setup: Vec<Action>) {
    let empty = [Action::Clear(None), Action::Drop, Action::Scene(Some(Scene::default()))];
    empty.into_iter().chain(setup).for_each(|action| arm.act(action));
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

    /// Runs the solution of an exercise. Returns how each of its programs ended.
    fn solve(tab: &mut Tab, attempt: &mut Attempt, parts: &[SolutionPart]) -> Vec<ProgramProgress> {
        let mut ends = Vec::new();
        for part in parts {
            match part {
                SolutionPart::Repair => tab.act("clear"),
                SolutionPart::Program(program) => {
                    let watch = |_, tab: &mut Tab| {
                        attempt.observe(&tab.situation());
                    };
                    ends.push(tab.run(program, watch).0);
                    // Enough time to confirm the hold after a failed program.
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
            let setup = exercise.setup.iter().map(|action| action.parse().expect("an action"));
            super::set_up(&mut tab.arm, setup.collect());
            let ends = solve(&mut tab, &mut attempt, &exercise.solution());
            assert_eq!(ends.last(), Some(&ProgramProgress::Over), "{title}: {ends:?}");
            let reached: Vec<_> = attempt.reached().collect();
            assert!(attempt.is_solved(), "{title}: {reached:?}");
        }
    }

    #[test]
    fn nothing_is_left_of_the_exercise_before() {
        let mut tab = Tab::new();
        for action in ["fault 1=wall=115", "scene cube red 30 40 0 200"] {
            tab.act(action);
        }
        assert_eq!(tab.situation().things.len(), 1);
        super::set_up(&mut tab.arm, Vec::new());
        let (address, values) =
            crate::arm_state::target_frame(tab.client.registers(), 1, 150.0).expect("a target");
        tab.client.write(tab.now(), address, &values);
        tab.pass(120);
        assert!(tab.situation().things.is_empty());
        assert!((tab.angles()[0] - 150.0).abs() < 1.0, "no wall: {:?}", tab.angles());
    }

    #[test]
    fn a_silent_joint_is_nowhere() {
        let mut tab = Tab::new();
        let seen = |tab: &Tab| tab.situation();
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
                attempt.observe(&tab.situation());
            }
            assert!(attempt.reached().all(|is_reached| !is_reached), "{}", exercise.title.of("en"));
        }
    }
}

//! A learner's attempt at an exercise: checks the goals against what the arm measures.

use crate::exercise::Exercise;
use crate::goal::Goal;
use crate::path::{PathProgress, distance};

/// A goal for a joint or a thing is reached after the joint or thing has been in place for this long, in seconds.
const AT_REST: f64 = 0.5;

/// The state of the arm and of the things on the table at one instant.
#[derive(Clone, Debug, Default)]
pub struct Situation {
    /// The time in seconds, from any fixed instant.
    pub seconds: f64,
    /// The tip: x, y, z in mm; `None` if one of joints 1 to 6 is not measured.
    pub tip: Option<[f64; 3]>,
    /// The angles in degrees, joint 1 first; `None` for a joint that is not measured.
    pub joints: [Option<f64>; 7],
    /// The blocked joints, as in register 195 (D27): bit n-1 for joint n.
    pub blocked: u8,
    /// The things on the table; empty for a real arm.
    pub things: Vec<SeenThing>,
}

/// The position of a thing on the table.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenThing {
    /// Its name in the scene.
    pub name: String,
    /// Its middle: x, y, z in mm.
    pub at: [f64; 3],
    /// While the arm carries it, it reaches no goal.
    pub is_carried: bool,
}

#[derive(Clone, Debug)]
enum GoalProgress {
    Reached,
    Open,
    Along(PathProgress),
    /// The joint has been at its angle, or the thing in its place, since this time, in seconds.
    There(f64),
}

/// The goals of an exercise, and which of them the learner has reached.
///
/// ```
/// use exercises::{Attempt, Exercise, Situation};
///
/// let text = r#"{"title": "Touch", "text": "Touch it.", "goals": [{"text": "the point", "tip": [0, 200, 50]}]}"#;
/// let mut attempt = Attempt::new(&Exercise::parse(text)?);
/// attempt.observe(&Situation { tip: Some([0.0, 203.0, 50.0]), ..Situation::default() });
/// assert!(attempt.is_solved());
/// # Ok::<(), exercises::ExerciseError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Attempt {
    goals: Vec<(Goal, GoalProgress)>,
    in_order: bool,
    /// The times of the first and the last situation, in seconds.
    seconds: Option<(f64, f64)>,
}

impl Attempt {
    /// Begins an attempt, with no goal reached.
    #[must_use]
    pub fn new(exercise: &Exercise) -> Self {
        let progress = |goal: &Goal| match goal {
            Goal::Path { path, within, .. } => GoalProgress::Along(PathProgress::new(path, *within)),
            _ => GoalProgress::Open,
        };
        let goals = exercise.goals.iter().map(|goal| (goal.clone(), progress(goal))).collect();
        Self { goals, in_order: exercise.in_order, seconds: None }
    }

    /// Checks the open goals against a situation; goals in order only up to the first that is not reached. Returns true if at
    /// least one of them is reached now. Has no effect after the exercise is solved.
    pub fn observe(&mut self, seen: &Situation) -> bool {
        if self.is_solved() {
            return false;
        }
        self.seconds = Some((self.seconds.map_or(seen.seconds, |(start, _)| start), seen.seconds));
        let mut is_any_reached = false;
        for (goal, progress) in &mut self.goals {
            if matches!(progress, GoalProgress::Reached) {
                continue;
            }
            if is_reached(goal, progress, seen) {
                *progress = GoalProgress::Reached;
                is_any_reached = true;
            } else if self.in_order {
                break;
            }
        }
        is_any_reached
    }

    /// Whether each goal is reached, in the order of the exercise.
    pub fn reached(&self) -> impl Iterator<Item = bool> {
        self.goals.iter().map(|(_, progress)| matches!(progress, GoalProgress::Reached))
    }

    /// Are all goals reached?
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.reached().all(|is_reached| is_reached)
    }

    /// The time from the first situation to the last one, in seconds. The situation that solves the exercise is the last one.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.seconds.map_or(0.0, |(start, end)| end - start)
    }
}

fn is_reached(goal: &Goal, progress: &mut GoalProgress, seen: &Situation) -> bool {
    match goal {
        Goal::Tip { tip, within, .. } => seen.tip.is_some_and(|at| distance(at, *tip) <= *within),
        Goal::Path { .. } => match progress {
            GoalProgress::Along(path) => path.observe(seen.tip),
            _ => false,
        },
        Goal::Joint { joint, degrees, within, .. } => {
            let at = seen.joints.get(usize::from(joint.saturating_sub(1))).copied().flatten();
            rests(progress, seen.seconds, at.is_some_and(|at| (at - degrees).abs() <= *within))
        }
        Goal::Thing { thing, at, within, .. } => {
            let found = seen.things.iter().find(|seen| seen.name == *thing && !seen.is_carried);
            rests(progress, seen.seconds, found.is_some_and(|seen| distance(seen.at, *at) <= *within))
        }
        Goal::Blocked { blocked, .. } => {
            1_u8.checked_shl(u32::from(blocked.saturating_sub(1))).is_some_and(|bit| seen.blocked & bit != 0)
        }
    }
}

/// Updates the progress of a goal for a joint or a thing. Returns true if the joint or thing has been in place for at least
/// [`AT_REST`].
fn rests(progress: &mut GoalProgress, seconds: f64, is_there: bool) -> bool {
    if !is_there {
        *progress = GoalProgress::Open;
    } else if !matches!(progress, GoalProgress::There(_)) {
        *progress = GoalProgress::There(seconds);
    }
    matches!(progress, GoalProgress::There(since) if seconds - *since >= AT_REST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attempt(goals: &str, rest: &str) -> Attempt {
        let text = format!(r#"{{"title": "t", "text": "t", "goals": [{goals}]{rest}}}"#);
        Attempt::new(&Exercise::parse(&text).unwrap_or_else(|error| panic!("{error}")))
    }

    fn seen(seconds: f64, joint_1: f64) -> Situation {
        let joints = [Some(joint_1), None, None, None, None, None, None];
        Situation { seconds, joints, ..Situation::default() }
    }

    #[test]
    fn a_joint_that_passes_an_angle_is_not_there() {
        let mut attempt = attempt(r#"{"text": "t", "joint": 1, "degrees": 120}"#, "");
        for (seconds, degrees) in [(0.0, 90.0), (0.1, 120.0), (0.2, 150.0), (0.7, 121.0), (1.1, 119.0)] {
            assert!(!attempt.observe(&seen(seconds, degrees)));
        }
        assert!(attempt.observe(&seen(1.2, 119.0)) && attempt.is_solved());
        assert!((attempt.duration() - 1.2).abs() < 1e-9);
        assert!(!attempt.observe(&seen(9.0, 0.0)) && attempt.is_solved(), "it stays solved");
        assert!((attempt.duration() - 1.2).abs() < 1e-9);
    }

    #[test]
    fn a_thing_that_is_carried_over_its_place_is_not_there() {
        let mut attempt = attempt(r#"{"text": "t", "thing": "red", "at": [80, 200, -45]}"#, "");
        let seen = |seconds, name: &str, x, is_carried| Situation {
            seconds,
            things: vec![SeenThing { name: name.to_owned(), at: [x, 200.0, -45.0], is_carried }],
            ..Situation::default()
        };
        for (seconds, name, x, is_carried) in [
            (0.0, "red", 80.0, true),
            (1.0, "red", 81.0, false),
            (1.2, "red", 120.0, false),
            (2.0, "blue", 80.0, false),
        ] {
            assert!(!attempt.observe(&seen(seconds, name, x, is_carried)));
            assert!(!attempt.observe(&seen(seconds + 0.1, name, x, is_carried)));
        }
        assert!(!attempt.observe(&seen(3.0, "red", 90.0, false)));
        assert!(attempt.observe(&seen(3.5, "red", 90.0, false)) && attempt.is_solved());
    }

    #[test]
    fn goals_in_order_wait_for_those_before_them() {
        let goals = r#"{"text": "a", "tip": [0, 200, 50]}, {"text": "b", "blocked": 2}"#;
        let at_b = Situation { blocked: 0b10, ..Situation::default() };
        let at_a = Situation { tip: Some([0.0, 200.0, 50.0]), ..Situation::default() };
        let mut ordered = attempt(goals, r#", "in_order": true"#);
        assert!(!ordered.observe(&at_b) && ordered.observe(&at_a) && ordered.observe(&at_b));
        assert!(ordered.is_solved());
        let mut any = attempt(goals, "");
        assert!(any.observe(&at_b) && !any.is_solved());
        assert_eq!(any.reached().collect::<Vec<_>>(), [false, true]);
    }

    #[test]
    fn what_is_wrong_in_a_file_is_told_with_its_line() {
        let refused = |text: &str| Exercise::parse(text).expect_err("no exercise").to_string();
        assert!(refused("{\n\"title\": 1}").starts_with("line 2: "));
        assert!(refused("no").contains("line 1"));
        let goal = |goal: &str| refused(&format!(r#"{{"title": "t", "text": "t", "goals": [{goal}]}}"#));
        assert_eq!(goal(""), "an exercise needs at least one goal");
        assert!(
            goal(r#"{"text": "t", "joint": 8, "degrees": 10}"#).contains("goal 1: use a joint from 1 to 7")
        );
        assert!(goal(r#"{"text": "t", "tip": [0, 1, 2], "within": 0}"#).contains("above 0"));
        assert!(goal(r#"{"text": "t", "path": [[0, 1, 2]]}"#).contains("2 to 100 points"));
        assert!(goal(r#"{"text": "t", "tpi": [0, 1, 2]}"#).contains("line 1"));
    }
}

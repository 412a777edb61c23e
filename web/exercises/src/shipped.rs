//! The exercises that ship with the page.

use crate::exercise::Exercise;

const FILES: [&str; 8] = [
    include_str!("../shipped/first-move.json"),
    include_str!("../shipped/five-points.json"),
    include_str!("../shipped/square.json"),
    include_str!("../shipped/stairs.json"),
    include_str!("../shipped/blocked.json"),
    include_str!("../shipped/pick-and-place.json"),
    include_str!("../shipped/sort.json"),
    include_str!("../shipped/stack.json"),
];

/// The shipped exercises, the easiest first.
#[must_use]
pub fn shipped() -> Vec<Exercise> {
    FILES.iter().filter_map(|text| Exercise::parse(text).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attempt::Attempt;

    #[test]
    fn each_shipped_exercise_can_be_read_has_hints_and_a_solution_and_nothing_is_reached_at_first() {
        assert_eq!(shipped().len(), FILES.len());
        for exercise in shipped() {
            let title = exercise.title.of("en");
            assert!(!exercise.hints.is_empty() && !exercise.solution().is_empty(), "{title}");
            assert_ne!(title, exercise.title.of("zh-CN"));
            assert!(Attempt::new(&exercise).reached().all(|is_reached| !is_reached), "{title}");
        }
    }
}

//! Exercises: what the arm does is compared with their goals.

use browser_tests::{Page, Viewed};

/// The page with the exercise of this number begun.
fn begun(viewed: &Viewed, number: &str) -> Page {
    let mut page = viewed.open();
    page.click("[data-action=exercises]");
    page.choose("#exercise-choice", number);
    page.click("[data-action=begin-exercise]");
    page.wait_for_text("#exercise-state", "Begun.");
    page
}

fn turn(page: &mut Page, joint: usize, degrees: &str) {
    page.type_into(&format!("#target-{joint}"), degrees);
}

#[test]
fn an_exercise_is_solved_by_what_the_arm_does() {
    let viewed = Viewed::without_arm();
    let mut page = begun(&viewed, "0");
    assert!(page.text("#exercise-goals").starts_with("○ Joint 1 rests at 120°"), "nothing is reached");
    turn(&mut page, 1, "120");
    page.wait_for_text("#exercise-goals", "✓ Joint 1 rests at 120°");
    assert!(page.text("#exercise-goals").contains("○ Joint 2"));
    turn(&mut page, 2, "110");
    page.wait_for_text("#exercise-state", "Solved! It took");
    assert!(page.text("#exercise-goals").contains("✓ Joint 2 rests at 110°"));
    page.click("[data-action=language]");
    page.wait_for_text("#exercise-goals", "✓ 关节 2 停在 110°");
    page.choose("#exercise-choice", "1");
    page.wait_for_text("#exercise-text", "触碰五个点");
    assert!(!page.text("#exercise-goals").contains('✓'));
}

#[test]
fn a_blocked_joint_is_found_and_freed() {
    let viewed = Viewed::without_arm();
    let mut page = begun(&viewed, "4");
    turn(&mut page, 1, "150");
    page.wait_for_text("#exercise-goals", "✓ Joint 1 is blocked");
    page.wait_for_text("#state", "Joint 1 is blocked");
    page.click("[data-action=repair]");
    turn(&mut page, 1, "150");
    page.wait_for_text("#exercise-state", "Solved! It took");
}

#[test]
fn hints_a_solution_and_an_exercise_of_a_file_are_shown() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.click("[data-action=exercises]");
    page.click("[data-action=save-result]");
    page.wait_for_text("#notice", "Begin the exercise first.");
    page.click("[data-action=hint]");
    page.wait_for_text("#exercise-hints", "A slider with its number");
    page.click("[data-action=solution]");
    page.wait_for_text("#python", "120");

    let file = viewed.path("own.json");
    std::fs::write(
        &file,
        r#"{"title": "Own", "text": "Turn <it>.", "goals": [{"text": "g", "joint": 9, "degrees": 1}]}"#,
    )
    .expect("a file");
    page.choose_file("#open-exercise", &file);
    page.wait_for_text("#notice", "This file is no exercise. goal 1: use a joint from 1 to 7");
    std::fs::write(
        &file,
        r#"{"title": "Own", "text": "Turn <it>.", "goals": [{"text": "g", "joint": 1, "degrees": 91}]}"#,
    )
    .expect("a file");
    page.choose_file("#open-exercise", &file);
    page.wait_for_text("#exercise-text", "Turn <it>.");
    page.click("[data-action=begin-exercise]");
    page.wait_for_text("#exercise-state", "Solved!");
}

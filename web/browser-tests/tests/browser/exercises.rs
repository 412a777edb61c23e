//! Exercises and scenes: goals, hints, solutions, and files of the user.

use browser_tests::{Page, Viewed};
use system_tests::wait::wait_until;

/// Opens the page, and begins the exercise with this index in the list, from 0.
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

/// Is something red drawn at this point of the room?
fn is_red_at(page: &mut Page, place: [f64; 3]) -> bool {
    page.centre("#scene");
    let [x, y] = page.project(place);
    let picture = page.picture();
    let is_red = |[red, green, blue]: [u8; 3]| red > 120 && green < 90 && blue < 90;
    let near = |at: f64| (-8..=8).map(move |step| (at + f64::from(step)) as usize);
    let points = near(y).flat_map(|y| near(x).map(move |x| (x, y)));
    points.filter(|(x, y)| is_red(picture.at(*x, *y))).count() > 40
}

#[test]
fn a_cube_is_picked_up_by_the_solution_and_put_where_it_should_be() {
    let viewed = Viewed::without_arm();
    let mut page = begun(&viewed, "5");
    page.wait_for_text("#exercise-goals", "○ The cube stands at 90, 180");
    wait_until("the cube is drawn", || is_red_at(&mut page, [0.0, 200.0, -45.0]));
    page.click("[data-action=solution]");
    page.wait_for_text("#python", "arm.set(\"effector-type\", 1)");
    page.click("[data-action=run]");
    page.wait_for_text("#exercise-goals", "✓ The cube stands at 90, 180");
    page.wait_for_text("#exercise-state", "Solved! It took");
    assert!(!is_red_at(&mut page, [0.0, 200.0, -45.0]), "it is somewhere else");
}

#[test]
fn a_scene_is_put_on_the_table_from_a_list_or_a_file() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    assert!(!is_red_at(&mut page, [0.0, 200.0, -45.0]));
    page.choose("#room", "cube red 30 40 0 200");
    page.click("[data-action=scene]");
    wait_until("the cube is drawn", || is_red_at(&mut page, [0.0, 200.0, -45.0]));
    let file = viewed.path("scene.txt");
    std::fs::write(&file, "# two\ncube red 30 40 80 200\ncube blue 30\n").expect("a file");
    page.choose_file("#open-scene", &file);
    page.wait_for_text("#notice", "This file is no scene: line 3 of the scene: use table Z");
    std::fs::write(&file, "# one\ncube red 30 40 80 200\n").expect("a file");
    page.choose_file("#open-scene", &file);
    wait_until("the file is read", || is_red_at(&mut page, [80.0, 200.0, -45.0]));
    assert!(!is_red_at(&mut page, [0.0, 200.0, -45.0]));
}

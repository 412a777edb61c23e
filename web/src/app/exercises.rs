//! Exercises: chooses and begins them, observes the arm, and saves the results.

use arm_sim::Action;
use exercises::{Attempt, Exercise, SolutionPart, shipped};
use js_sys::Date;
use protocol_core::time::Instant;
use wasm_bindgen::JsValue;
use web_sys::Element;

use super::dom::{Dom, set_attribute, set_text};
use super::files;
use super::page::{App, ArmLine};
use crate::exercise::{set_up, situation};

impl App {
    /// Carries out the action of a button. Returns false if the action does not belong to exercises.
    pub(super) fn act_on_exercise(&mut self, action: &str) -> bool {
        match action {
            "exercises" => self.toggle_exercises(),
            "begin-exercise" => self.begin_exercise(),
            "hint" => {
                self.exercises.shown_hints += 1;
                self.show_exercise();
            }
            "solution" => self.show_solution(),
            "save-result" => self.save_result(),
            _ => return false,
        }
        true
    }

    fn toggle_exercises(&mut self) {
        self.exercises.is_open = !self.exercises.is_open;
        let is_open = self.exercises.is_open;
        if self.exercises.all.is_empty() {
            self.exercises.all = shipped();
        }
        self.dom.set_hidden("exercise", !is_open);
        for button in self.dom.all("[data-action=exercises]") {
            set_attribute(&button, "aria-pressed", if is_open { "true" } else { "false" });
        }
        self.show_exercise();
    }

    pub(super) fn choose_exercise(&mut self) {
        self.exercises.choose(self.dom.choice("exercise-choice").parse().unwrap_or(0));
        self.show_exercise();
    }

    /// Opens the text of a file with an exercise, and chooses the exercise.
    pub(super) fn open_exercise(&mut self, text: String) {
        match Exercise::parse(&text) {
            Ok(exercise) => {
                self.exercises.all.push(exercise);
                self.exercises.choose(self.exercises.all.len() - 1);
                self.dom.end_notice();
                self.show_exercise();
            }
            Err(error) => self.dom.notice(&format!("{} {error}", self.language.text("no-exercise"))),
        }
    }

    /// Begins an attempt: sets the exercise up, and observes the arm from now on.
    fn begin_exercise(&mut self) {
        let Some(exercise) = self.exercises.exercise() else { return };
        let attempt = Attempt::new(exercise);
        let actions: Result<Vec<Action>, _> = exercise.setup.iter().map(|action| action.parse()).collect();
        match (actions, &mut self.line) {
            (Err(error), _) => {
                return self.dom.notice(&format!("{} {error}", self.language.text("no-exercise")));
            }
            (Ok(actions), ArmLine::Simulated(source)) => set_up(source, actions),
            (Ok(actions), _) if actions.is_empty() => {}
            _ => return self.dom.notice(self.language.text("exercise-needs-simulation")),
        }
        self.exercises.attempt = Some(attempt);
        self.show_exercise();
    }

    /// Passes the new registers and the things of a simulated arm's room to the attempt. Shows each goal that is reached.
    pub(super) fn observe_exercise(&mut self, now: Instant) {
        let seen = situation(now, self.client.registers(), self.world());
        let Some(attempt) = &mut self.exercises.attempt else { return };
        if attempt.observe(&seen) {
            self.show_exercise();
        }
    }

    /// Shows the first program of the solution in the editor. A solution may continue with a repair and further programs.
    fn show_solution(&mut self) {
        let solution = self.exercises.exercise().map(Exercise::solution).unwrap_or_default();
        match solution.into_iter().find_map(|part| match part {
            SolutionPart::Program(text) => Some(text),
            SolutionPart::Repair => None,
        }) {
            Some(program) => self.show_in_editor(program),
            None => self.dom.notice(self.language.text("no-solution")),
        }
    }

    /// Saves title, date, goals with marks, and the time of a solution as a text file.
    fn save_result(&self) {
        let (Some(exercise), Some(attempt)) = (self.exercises.exercise(), &self.exercises.attempt) else {
            return self.dom.notice(self.language.text("exercise-not-begun"));
        };
        let tag = self.language.tag();
        let goals: String = lines(exercise, Some(attempt), tag).map(|line| format!("{line}\n")).collect();
        let date = String::from(Date::new_0().to_locale_string(tag, &JsValue::UNDEFINED));
        let state = self.exercise_state();
        files::save(
            &self.dom,
            "result.txt",
            &format!("{}\n{date}\n\n{goals}\n{state}\n", exercise.title.of(tag)),
        );
    }

    fn exercise_state(&self) -> String {
        match &self.exercises.attempt {
            None => self.language.text("exercise-begin").to_owned(),
            Some(attempt) if attempt.is_solved() => {
                format!("{} {:.0} s", self.language.text("exercise-solved"), attempt.duration())
            }
            Some(_) => self.language.text("exercise-runs").to_owned(),
        }
    }

    /// Shows the exercise and its reached goals, in the language of the page.
    pub(super) fn show_exercise(&self) {
        // It fails only if the page lacks an element.
        let _ = self.try_show_exercise();
    }

    fn try_show_exercise(&self) -> Result<(), JsValue> {
        let (dom, tag) = (&self.dom, self.language.tag());
        let Some(exercise) = self.exercises.exercise() else { return Ok(()) };
        let titles = self.exercises.all.iter().map(|exercise| exercise.title.of(tag).to_owned());
        fill(dom, "exercise-choice", "option", titles)?;
        for (option, index) in dom.all("#exercise-choice option").iter().zip(0..) {
            option.set_attribute("value", &format!("{index}"))?;
        }
        dom.choose("exercise-choice", &self.exercises.chosen.to_string());
        dom.set_text("exercise-text", exercise.text.of(tag));
        fill(dom, "exercise-goals", "li", lines(exercise, self.exercises.attempt.as_ref(), tag))?;
        let hints = exercise.hints.iter().take(self.exercises.shown_hints);
        fill(dom, "exercise-hints", "li", hints.map(|hint| hint.of(tag).to_owned()))?;
        dom.set_text("exercise-state", &self.exercise_state());
        Ok(())
    }
}

/// One line for each goal, in the language of a tag, with a mark that tells whether the goal is reached.
fn lines(exercise: &Exercise, attempt: Option<&Attempt>, tag: &str) -> impl Iterator<Item = String> {
    let reached = attempt.map(|attempt| attempt.reached().collect::<Vec<_>>()).unwrap_or_default();
    exercise.goals.iter().enumerate().map(move |(index, goal)| {
        let mark = if reached.get(index) == Some(&true) { "✓" } else { "○" };
        format!("{mark} {}", goal.text().of(tag))
    })
}

/// Fills a list with one element of this kind for each text. Keeps existing elements, and removes only those without a text.
fn fill(dom: &Dom, id: &str, kind: &str, texts: impl Iterator<Item = String>) -> Result<(), JsValue> {
    let list: Element = dom.get(id)?;
    let texts: Vec<_> = texts.collect();
    while list.child_element_count() as usize > texts.len() {
        list.last_element_child().iter().for_each(Element::remove);
    }
    while (list.child_element_count() as usize) < texts.len() {
        dom.add(&list, kind)?;
    }
    for (element, text) in dom.all(&format!("#{id} > {kind}")).iter().zip(&texts) {
        set_text(element, text);
    }
    Ok(())
}

//! The panels that show the state of the arm: the line of its state, joints, tip, supply, recording, frames and registers.

use std::fmt::Display;
use std::str::FromStr;

use host_link::sharing::{DrivenBy, SharingState};
use sevenbot::map::{EXTENDED_VERSION, SERVO_TEMPERATURE, SPEED, VACUUM_PUMP};
use sevenbot::{Span, register_text};
use wasm_bindgen::JsValue;
use web_sys::{Element, HtmlInputElement};

use super::dom::{Dom, set_attribute, set_text};
use super::page::{App, ArmLine};
use crate::arm_state::{ArmState, misplaced, tip};
use crate::source::LineState;
use crate::texts::Language;
use crate::words::{Answers, state_line};

/// The highest angle of the slider of each joint, in degrees. For joint 7 the claw is open there.
const HIGHEST: [&str; 7] = ["180", "180", "180", "180", "180", "180", "84"];
/// The ids of the fields with the position of the tip, in mm.
pub(super) const TIP_FIELDS: [&str; 3] = ["tip-x", "tip-y", "tip-z"];
/// The registers in the table, without the protection block and the registers of a server.
const SHOWN: [std::ops::RangeInclusive<u8>; 3] =
    [0..=60, 128..=EXTENDED_VERSION.address, 240..=SERVO_TEMPERATURE.address];

/// Creates the repeated elements: a row with slider and field for each joint, and the joints in the list of faults.
pub(super) fn build(dom: &Dom) -> Result<(), JsValue> {
    let joints: Element = dom.get("joints")?;
    let broken: Element = dom.get("fault-joint")?;
    for (number, highest) in (1..=7).zip(HIGHEST) {
        let row = dom.add(&joints, "div")?;
        row.set_class_name("joint");
        row.set_id(&format!("row-{number}"));
        let label = dom.add(&row, "label")?;
        let name = format!("joint-{number}");
        label.set_id(&format!("name-{number}"));
        label.set_attribute("for", &name)?;
        label.set_attribute("data-text", &name)?;
        let measured = dom.add(&row, "output")?;
        measured.set_id(&format!("angle-{number}"));
        measured.set_attribute("aria-live", "off")?;
        for (kind, id) in [("range", &name), ("number", &format!("target-{number}"))] {
            let field = dom.add(&row, "input")?;
            let joint = number.to_string();
            for (name, value) in [("type", kind), ("min", "0"), ("max", highest), ("data-joint", &joint)] {
                field.set_attribute(name, value)?;
            }
            field.set_id(id);
            field.set_attribute("aria-labelledby", &label.id())?;
        }
        let option = dom.add(&broken, "option")?;
        option.set_attribute("value", &number.to_string())?;
        option.set_attribute("data-text", &name)?;
    }
    Ok(())
}

/// Updates all panels to the present state of the arm.
pub(super) fn show(app: &mut App, state: &ArmState) {
    app.show_watching();
    show_line(app, state);
    show_recording(app);
    app.show_program();
    if app.client.rounds() == 0 {
        return show_nothing_known(&app.dom, app.language);
    }
    let (dom, language) = (&app.dom, app.language);
    show_joints(dom, language, state);
    if app.client.rounds() >= app.slid_round {
        let step = if app.client.registers().has_extended_block() { "0.5" } else { "1" };
        show_targets(dom, state, step);
    }
    dom.press("motors", &state.motor_state.to_string());
    show_speed_and_pump(app);
    let [x, y, z] = tip(state.angles());
    // Sliders do not check the workspace. So warn here, for the measured pose or the targets.
    let at = misplaced(state.angles()).or(misplaced(state.targets));
    let reach = app.unreachable.map(|(_, why)| why).or(at);
    let reach = reach.map_or(String::new(), |why| format!(" · {}", language.text(why)));
    dom.set_text("tip", &format!("{}: x {x:.0}, y {y:.0}, z {z:.0} mm{reach}", language.text("tip")));
    dom.set_text("health", &health(app, state));
    if let ArmLine::Simulated(source) = &app.line {
        app.dom.set_text("time", &format!("{:.1} s", seconds(source.now())));
    }
    if is_open(&app.dom, "frames-panel") {
        show_frames(app);
    }
    if is_open(&app.dom, "registers-panel") {
        show_registers(app);
    }
}

fn show_speed_and_pump(app: &App) {
    let (dom, registers) = (&app.dom, app.client.registers());
    dom.press("pump", &registers.byte(&VACUUM_PUMP).to_string());
    let [first, others @ ..] = registers.joints(&SPEED);
    // If the joints have different speeds, show no choice.
    let is_one = others.iter().all(|&other| other == first);
    let speed = if is_one { first.to_string() } else { String::new() };
    if dom.element("joint-speed").is_some_and(|choice| !dom.has_focus(&choice)) {
        dom.choose("joint-speed", &speed);
    }
}

/// Shows the measured values as unknown, because no arm has answered yet.
fn show_nothing_known(dom: &Dom, language: Language) {
    let unknown = language.text("not-measured");
    for number in 1..=7 {
        dom.set_text(&format!("angle-{number}"), unknown);
    }
    dom.press("motors", "");
    dom.set_text("tip", &format!("{}: {unknown}", language.text("tip")));
    dom.set_text("health", "");
}

/// The line with the supply voltage and the temperature, as far as they are known, and whether another client moves the arm.
fn health(app: &App, state: &ArmState) -> String {
    let language = app.language;
    let sharing = SharingState::of(app.client.registers());
    let is_driven = sharing.is_some_and(|sharing| sharing.driven_by == DrivenBy::Another);
    let another = is_driven.then(|| language.text("another-drives").to_owned());
    let volts = state.volts.map(|volts| format!("{} {volts:.1} V", language.text("supply")));
    let celsius = state.celsius.map(|celsius| format!("{} {celsius} °C", language.text("temperature")));
    another.into_iter().chain(volts).chain(celsius).collect::<Vec<_>>().join(" · ")
}

fn show_line(app: &mut App, state: &ArmState) {
    let answers = match (app.client.rounds(), app.line_state(), app.client.is_connected()) {
        (0, ..) => Answers::NotYet,
        (_, LineState::Closed(_), _) => Answers::LineEnded,
        (.., true) => Answers::Yes,
        (.., false) => Answers::NoLonger,
    };
    let doing = match (&app.player, &app.park, &app.programs.run) {
        (Some(_), ..) => Some("plays"),
        (_, Some(_), _) => Some("parks"),
        (.., Some(_)) => Some("program-runs"),
        _ => None,
    };
    let (line, mood) = state_line(app.language, answers, state, (app.client.stop_progress(), doing));
    let watching = if app.only_watches() { app.language.text("watch-only") } else { "" };
    app.dom.set_text("state", format!("{line} {watching}").trim_end());
    if let Some(element) = app.dom.element("state") {
        set_attribute(&element, "class", mood.class());
    }
}

fn show_joints(dom: &Dom, language: Language, state: &ArmState) {
    for (index, measured) in (0..).zip(state.measured) {
        let number = index + 1;
        let is_missing = state.missing >> index & 1 == 1;
        let angle = match measured {
            _ if is_missing => language.text("no-answer").to_owned(),
            Some(angle) => format!("{angle:.1}°"),
            None => language.text("not-measured").to_owned(),
        };
        dom.set_text(&format!("angle-{number}"), &angle);
        if let Some(row) = dom.element(&format!("row-{number}")) {
            let is_bad = (state.missing | state.stalled) >> index & 1 == 1;
            set_attribute(&row, "class", if is_bad { "joint bad" } else { "joint" });
        }
    }
}

/// Sets the sliders and the fields of the joints and the tip to the targets. `step` is the resolution of the joints in
/// degrees.
fn show_targets(dom: &Dom, state: &ArmState, step: &str) {
    for (number, target) in (1..).zip(state.targets) {
        for id in [format!("joint-{number}"), format!("target-{number}")] {
            let Ok(field) = dom.get::<HtmlInputElement>(&id) else { continue };
            set_attribute(&field, "step", step);
            show_number(dom, &field, target);
        }
    }
    for (axis, position) in TIP_FIELDS.into_iter().zip(tip(state.targets)) {
        if let Ok(field) = dom.get::<HtmlInputElement>(axis) {
            show_number(dom, &field, position.round());
        }
    }
}

/// Sets a field or slider to a number, unless the user is typing in the field.
fn show_number(dom: &Dom, field: &HtmlInputElement, number: impl Display + FromStr + PartialEq) {
    let is_typed = field.type_() == "number" && dom.has_focus(field);
    if !is_typed && field.value().parse().ok().as_ref() != Some(&number) {
        field.set_value(&number.to_string());
    }
}

fn show_recording(app: &App) {
    let text = |name| app.language.text(name);
    let line = match (&app.recorder, &app.player, &app.recording) {
        (Some(_), ..) => format!("● {}", text("record")),
        (_, Some(player), _) => format!("{} {:.0} %", text("playing"), player.progress() * 100.0),
        (_, _, Some(recording)) => {
            let (moments, seconds) = (recording.moments, recording.length.as_secs_f64());
            format!("{}: {moments} {}, {seconds:.1} s", text("recorded"), text("points"))
        }
        _ => text("no-recording").to_owned(),
    };
    app.dom.set_text("recording", &line);
    for button in app.dom.all("[data-action=record]") {
        set_attribute(&button, "aria-pressed", if app.recorder.is_some() { "true" } else { "false" });
    }
}

fn show_frames(app: &App) {
    let Some(list) = app.dom.element("frames") else { return };
    let frames = app.client.frames().rev().map(|(time, is_to_arm, traffic)| {
        format!("{:9.3} {} {traffic}", seconds(*time), if *is_to_arm { "→" } else { "←" })
    });
    let text = frames.collect::<Vec<_>>().join("\n");
    if list.get_attribute("data-shown").as_deref() == Some(text.as_str()) {
        return;
    }
    set_attribute(&list, "data-shown", &text);
    list.set_text_content(None);
    for line in text.lines() {
        if let Ok(item) = app.dom.add(&list, "li") {
            set_text(&item, line);
        }
    }
}

fn show_registers(app: &App) {
    let Some(table) = app.dom.element("registers") else { return };
    let registers = app.client.registers();
    for range in SHOWN {
        let (first, last) = (*range.start(), *range.end());
        let values =
            registers.values.get(usize::from(first)..=usize::from(last)).unwrap_or_default().to_vec();
        for entry in register_text::entries(&sevenbot::Snapshot { address: first, values }) {
            let id = format!("register-{}", entry.address);
            if app.dom.element(&id).is_none() && add_register(&app.dom, &table, &id, &entry).is_err() {
                return;
            }
            app.dom.set_text(&format!("{id}-meaning"), &entry.meaning);
            if let Ok(input) = app.dom.get::<HtmlInputElement>(&format!("{id}-value")) {
                if !app.dom.has_focus(&input) && input.value() != entry.value {
                    input.set_value(&entry.value);
                }
            } else {
                app.dom.set_text(&format!("{id}-value"), &entry.value);
            }
        }
    }
}

fn add_register(
    dom: &Dom,
    table: &Element,
    id: &str,
    entry: &register_text::RegisterEntry,
) -> Result<(), JsValue> {
    let row = dom.add(table, "tr")?;
    row.set_id(id);
    set_text(&dom.add(&row, "td")?, &format!("{} {}", entry.address, entry.name));
    let value = dom.add(&row, "td")?;
    let count = u8::try_from(entry.bytes.len()).unwrap_or(1);
    let can_write = Span::new(entry.address, count).is_some() && is_writable(entry.address);
    let value = if can_write { dom.add(&value, "input")? } else { value };
    value.set_id(&format!("{id}-value"));
    if can_write {
        value.set_attribute("data-register", &entry.address.to_string())?;
        value.set_attribute("inputmode", "numeric")?;
        value.set_attribute("aria-label", &entry.name)?;
    }
    dom.add(&row, "td")?.set_id(&format!("{id}-meaning"));
    Ok(())
}

fn is_writable(address: u8) -> bool {
    use protocol_core::registers::Access;
    sevenbot::map::find(address).is_some_and(|row| row.access == Access::ReadWrite)
}

fn is_open(dom: &Dom, id: &str) -> bool {
    dom.element(id).is_some_and(|panel| panel.has_attribute("open"))
}

#[expect(clippy::cast_precision_loss, reason = "times of years are exact enough")]
fn seconds(time: protocol_core::time::Instant) -> f64 {
    time.as_micros() as f64 / 1e6
}

//! The simulator's answers as text.

use std::io::{self, Write};

use serde_json::Value;

/// A string in an answer; empty if it is missing.
fn string<'a>(value: &'a Value, key: &str) -> &'a str {
    value.get(key).and_then(Value::as_str).unwrap_or_default()
}

fn number(value: &Value, key: &str) -> f64 {
    value.get(key).and_then(Value::as_f64).unwrap_or_default()
}

fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// The answer to a new fault, to `list` or to `clear`.
pub(super) fn faults(out: &mut dyn Write, action: &str, value: &Value) -> io::Result<()> {
    match action {
        "list" if list(value, "faults").is_empty() && list(value, "ended_faults").is_empty() => {
            writeln!(out, "no faults")
        }
        "list" => both_lists(out, value),
        "clear" => reports(out, "cleared", list(value, "ended")),
        fault => {
            reports(out, "replaced", list(value, "replaced"))?;
            writeln!(out, "{:9} {fault}", "active")
        }
    }
}

fn both_lists(out: &mut dyn Write, value: &Value) -> io::Result<()> {
    reports(out, "active", list(value, "faults"))?;
    reports(out, "ended", list(value, "ended_faults"))
}

fn reports(out: &mut dyn Write, what: &str, reports: &[Value]) -> io::Result<()> {
    for report in reports {
        write!(out, "{what:9} {}", string(report, "text"))?;
        match report.get("remaining_ms").and_then(Value::as_u64).filter(|_| what == "active") {
            Some(millis) => writeln!(out, " ({millis} ms left)")?,
            None => writeln!(out)?,
        }
    }
    Ok(())
}

/// The answer to `hand`.
pub(super) fn hand(out: &mut dyn Write, joint: u8, value: &Value) -> io::Result<()> {
    write!(out, "joint {joint} is at {:.1} degrees", number(value, "angle_degrees"))?;
    if value.get("has_torque") == Some(&Value::Bool(true)) {
        write!(out, ", and its motor turns it back")?;
    }
    writeln!(out)
}

/// The answer to `snapshot` or `restore`.
pub(super) fn snapshot(out: &mut dyn Write, value: &Value) -> io::Result<()> {
    writeln!(out, "snapshot    {} at {:.3} s", string(value, "snapshot"), number(value, "time_us") / 1e6)
}

/// The virtual time, and its speed if the answer has it.
pub(super) fn time(out: &mut dyn Write, value: &Value) -> io::Result<()> {
    writeln!(out, "time        {:.3} s{}", number(value, "time_us") / 1e6, speed(value))
}

fn speed(value: &Value) -> String {
    match value.get("speed") {
        Some(Value::String(word)) => format!(", {}", if word == "max" { "speed max" } else { word }),
        Some(factor) => format!(", speed {factor}"),
        None => String::new(),
    }
}

/// The things on the table, and in the gripper.
pub(super) fn objects(out: &mut dyn Write, value: &Value) -> io::Result<()> {
    for object in list(value, "objects") {
        let place = list(object, "place_mm").iter().filter_map(Value::as_f64);
        let place: String = place.map(|mm| format!("{mm:8.1}")).collect();
        let carried = if object.get("is_carried") == Some(&Value::Bool(true)) { "   carried" } else { "" };
        writeln!(out, "{:16}{place} mm{carried}", string(object, "name"))?;
    }
    Ok(())
}

pub(super) fn state(out: &mut dyn Write, value: &Value) -> io::Result<()> {
    writeln!(out, "port        {}", string(value, "port"))?;
    time(out, value)?;
    writeln!(out, "controller  {}", string(value, "controller"))?;
    writeln!(out, "supply      {:.1} V", number(value, "supply_volts"))?;
    writeln!(out, "weight      {} g", number(value, "weight_grams"))?;
    writeln!(out)?;
    writeln!(out, "joint    true angle   torque   servo      load")?;
    for joint in list(value, "joints") {
        let held = if joint.get("is_held") == Some(&Value::Bool(true)) { "   held by a hand" } else { "" };
        writeln!(
            out,
            "{:5} {:10.2} deg   {:7} {:6} {:7.1} %{held}",
            number(joint, "joint"),
            number(joint, "angle_degrees"),
            string(joint, "torque"),
            number(joint, "servo_position"),
            number(joint, "load_percent"),
        )?;
    }
    if !list(value, "objects").is_empty() {
        writeln!(out)?;
        objects(out, value)?;
    }
    if !list(value, "faults").is_empty() || !list(value, "ended_faults").is_empty() {
        writeln!(out)?;
    }
    both_lists(out, value)
}

//! Draws a plot with the 2D context of a canvas.

use wasm_bindgen::JsValue;
use web_sys::CanvasRenderingContext2d as Context;

use super::axis::ValueAxis;
use super::history::{History, PlottedQuantity};
use crate::scene::theme::{Palette, Theme};

/// Margins of the plot, in CSS pixels. The left and the lower margin hold the numbers of the axes.
const LEFT: f64 = 44.0;
const BELOW: f64 = 20.0;
const RIGHT: f64 = 8.0;
/// Height of a line of text, in CSS pixels.
const TEXT: f64 = 16.0;
/// Width of an entry of the legend, in CSS pixels.
const ENTRY: f64 = 34.0;
const FONT: &str = "12px system-ui, sans-serif";

/// What [`draw`] shows of a [`History`], in which size and colours.
#[derive(Clone, Copy, Debug)]
pub struct Plot<'a> {
    /// The quantity on the vertical axis.
    pub quantity: PlottedQuantity,
    /// The name of the quantity with its unit, such as "Angle (°)".
    pub title: &'a str,
    /// The unit of time, such as "s".
    pub seconds: &'a str,
    /// Which of joints 1 to 7 have a line.
    pub shown: [bool; 7],
    /// The colours: for a light or a dark page.
    pub theme: Theme,
    /// Width and height of the canvas, in CSS pixels.
    pub size: [f64; 2],
    /// Device pixels per CSS pixel. The canvas has `size` times `ratio` pixels.
    pub ratio: f64,
}

/// The rectangle in which the lines are drawn, in CSS pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Area {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
}

impl Area {
    fn x(&self, part: f64) -> f64 {
        self.left + part * self.width
    }

    fn y(&self, axis: &ValueAxis, value: f32) -> f64 {
        self.top + (1.0 - f64::from(axis.place(value))) * self.height
    }
}

/// The height of the title and the legend in a plot of this width, both in CSS pixels.
#[must_use]
pub fn legend_height(width: f64) -> f64 {
    if is_narrow(width) { 2.0 * TEXT + 12.0 } else { TEXT + 12.0 }
}

/// Is the plot too narrow for the legend beside the title?
fn is_narrow(width: f64) -> bool {
    width < LEFT + 7.0 * ENTRY + 130.0
}

/// Draws a plot of the last seconds of a history.
///
/// # Errors
/// The browser throws an exception. With a valid context, no such case is known.
pub fn draw(context: &Context, plot: &Plot, history: &History) -> Result<(), JsValue> {
    let ([width, height], palette) = (plot.size, plot.theme.palette());
    context.set_transform(plot.ratio, 0.0, 0.0, plot.ratio, 0.0, 0.0)?;
    context.set_fill_style_str(&palette.table.css());
    context.fill_rect(0.0, 0.0, width, height);
    let top = legend_height(width);
    let area = Area {
        left: LEFT,
        top,
        width: (width - LEFT - RIGHT).max(1.0),
        height: (height - top - BELOW).max(1.0),
    };
    let axis = axis_of(plot, history);
    context.set_font(FONT);
    context.set_line_width(1.0);
    draw_axes(context, plot, area, &axis, history.seconds())?;
    draw_legend(context, plot, palette)?;
    draw_lines(context, plot, area, &axis, history);
    Ok(())
}

/// The vertical axis: fixed for angles, fitted to the values for loads and velocities.
fn axis_of(plot: &Plot, history: &History) -> ValueAxis {
    let least = match plot.quantity {
        PlottedQuantity::Angle => return ValueAxis { low: 0.0, high: 180.0, step: 45.0 },
        PlottedQuantity::Load | PlottedQuantity::Velocity => 10.0,
    };
    let values = history.samples().flat_map(|sample| {
        let joints = sample.values(plot.quantity).iter().zip(plot.shown);
        joints.filter(|(_, is_shown)| *is_shown).map(|(value, _)| *value)
    });
    ValueAxis::around_zero(values, least, 4.0)
}

fn draw_axes(
    context: &Context,
    plot: &Plot,
    area: Area,
    axis: &ValueAxis,
    seconds: f64,
) -> Result<(), JsValue> {
    let palette = plot.theme.palette();
    context.set_fill_style_str(&palette.text.css());
    context.set_text_baseline("middle");
    context.set_text_align("right");
    for tick in axis.ticks() {
        let y = area.y(axis, tick).round() + 0.5;
        rule(context, palette, tick == 0.0, [area.left, y], [area.x(1.0), y]);
        context.fill_text(&format!("{tick}"), area.left - 6.0, y)?;
    }
    context.set_text_baseline("top");
    context.set_text_align("center");
    for quarter in 0..=4_u8 {
        let part = f64::from(quarter) / 4.0;
        let x = area.x(part).round() + 0.5;
        rule(context, palette, false, [x, area.top], [x, area.top + area.height]);
        let time = (part - 1.0) * seconds;
        let below = area.top + area.height + 5.0;
        if quarter == 4 {
            context.set_text_align("right");
            context.fill_text(&format!("0 {}", plot.seconds), area.x(1.0), below)?;
        } else {
            context.fill_text(&format!("{time}"), x, below)?;
        }
    }
    Ok(())
}

fn rule(context: &Context, palette: &Palette, is_strong: bool, [x, y]: [f64; 2], [to_x, to_y]: [f64; 2]) {
    let colour = if is_strong { palette.text } else { palette.grid };
    context.set_stroke_style_str(&colour.css());
    context.begin_path();
    context.move_to(x, y);
    context.line_to(to_x, to_y);
    context.stroke();
}

/// Draws the title, and for each shown joint a short line in its colour and its number.
fn draw_legend(context: &Context, plot: &Plot, palette: &Palette) -> Result<(), JsValue> {
    let [width, _] = plot.size;
    context.set_text_align("left");
    context.set_text_baseline("middle");
    context.fill_text(plot.title, 8.0, TEXT / 2.0 + 3.0)?;
    let (mut x, y) = if is_narrow(width) {
        (8.0, TEXT * 1.5 + 3.0)
    } else {
        (width - 7.0 * ENTRY - RIGHT, TEXT / 2.0 + 3.0)
    };
    for ((joint, colour), is_shown) in (1..).zip(palette.joints).zip(plot.shown) {
        if is_shown {
            context.set_fill_style_str(&colour.css());
            context.fill_rect(x, y - 1.5, 14.0, 3.0);
            context.set_fill_style_str(&palette.text.css());
            context.fill_text(&format!("{joint}"), x + 18.0, y)?;
        }
        x += ENTRY;
    }
    Ok(())
}

fn draw_lines(context: &Context, plot: &Plot, area: Area, axis: &ValueAxis, history: &History) {
    context.set_line_width(1.5);
    context.set_line_join("round");
    let (end, seconds) = (history.end(), history.seconds());
    let colours = plot.theme.palette().joints;
    for ((joint, colour), is_shown) in colours.into_iter().enumerate().zip(plot.shown) {
        if !is_shown {
            continue;
        }
        context.set_stroke_style_str(&colour.css());
        context.begin_path();
        for sample in history.samples() {
            let value = sample.values(plot.quantity).get(joint).copied().unwrap_or_default();
            let part = 1.0 - (end - sample.time) / seconds;
            // On an empty path, `line_to` acts as `move_to`.
            context.line_to(area.x(part), area.y(axis, value));
        }
        context.stroke();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plots::Sample;

    const PLOT: Plot = Plot {
        quantity: PlottedQuantity::Velocity,
        title: "Velocity (°/s)",
        seconds: "s",
        shown: [true, true, false, true, true, true, true],
        theme: Theme::Light,
        size: [400.0, 160.0],
        ratio: 1.0,
    };

    #[test]
    fn the_axis_of_velocities_fits_the_joints_that_are_shown() {
        let mut history = History::new(10.0);
        let velocities = [0.0, -61.0, 900.0, 5.0, 0.0, 0.0, 0.0];
        history.push(Sample { velocities, ..Sample::default() });
        assert_eq!(axis_of(&PLOT, &history), ValueAxis { low: -100.0, high: 100.0, step: 50.0 });
        let angles = Plot { quantity: PlottedQuantity::Angle, ..PLOT };
        assert_eq!(axis_of(&angles, &history), ValueAxis { low: 0.0, high: 180.0, step: 45.0 });
    }

    #[test]
    fn values_and_times_have_places_in_the_area() {
        let area = Area { left: 40.0, top: 20.0, width: 300.0, height: 100.0 };
        let axis = ValueAxis { low: 0.0, high: 180.0, step: 45.0 };
        assert_eq!((area.x(0.0), area.x(1.0)), (40.0, 340.0));
        assert_eq!([0.0, 90.0, 180.0].map(|value| area.y(&axis, value)), [120.0, 70.0, 20.0]);
    }
}

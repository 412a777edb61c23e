//! An SVG picture of the screen, for documents. Lines and Braille dots are drawn, so they join in every font. Text is
//! stretched to its cells.

use std::fmt::Write;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

use super::draw::draw;
use super::view::View;
use crate::plot::escaped;

/// Size of the screen in cells.
const SCREEN: (u16, u16) = (100, 32);
/// Size of a cell in pixels.
const CELL: (u16, u16) = (9, 18);
/// Margin around the screen in pixels.
const MARGIN: u16 = 12;
const BACKGROUND: &str = "#14181f";
const FOREGROUND: &str = "#d7dce2";
/// The first Braille pattern of Unicode. The low byte selects the dots.
const BRAILLE: u32 = 0x2800;

/// The view as an SVG picture.
pub(crate) fn picture(view: &View) -> String {
    // Drawing to memory cannot fail.
    let Ok(mut terminal) = Terminal::new(TestBackend::new(SCREEN.0, SCREEN.1));
    let Ok(_) = terminal.draw(|frame| draw(frame, view));
    svg(terminal.backend().buffer())
}

fn svg(screen: &Buffer) -> String {
    let (width, height) = (screen.area.width * CELL.0 + 2 * MARGIN, screen.area.height * CELL.1 + 2 * MARGIN);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\">\n<style>text {{ font: 15px ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, \
         monospace }}</style>\n\
         <rect width=\"100%\" height=\"100%\" rx=\"8\" fill=\"{BACKGROUND}\"/>\n"
    );
    for y in 0..screen.area.height {
        row(&mut out, screen, y);
    }
    out.push_str("</svg>\n");
    out
}

fn row(out: &mut String, screen: &Buffer, y: u16) {
    let cells: Vec<(u16, &Cell)> =
        (0..screen.area.width).filter_map(|x| Some((x, screen.cell((x, y))?))).collect();
    for run in cells.chunk_by(|(_, one), (_, next)| is_same_run(one, next)) {
        let Some((x, first)) = run.first() else { continue };
        let symbols: String = run.iter().map(|(_, cell)| cell.symbol()).collect();
        if is_drawn(first) {
            run.iter().for_each(|(x, cell)| shapes(out, *x, y, cell));
        } else {
            text(out, *x, y, &symbols, first);
        }
    }
}

fn is_same_run(one: &Cell, next: &Cell) -> bool {
    (one.fg, one.modifier, is_drawn(one)) == (next.fg, next.modifier, is_drawn(next))
}

fn is_drawn(cell: &Cell) -> bool {
    cell.symbol().chars().next().is_some_and(|symbol| dots(symbol).is_some() || path(symbol).is_some())
}

/// Draws word by word, because SVG viewers treat spaces differently.
fn text(out: &mut String, x: u16, y: u16, symbols: &str, style: &Cell) {
    let weight = if style.modifier.contains(Modifier::BOLD) { " font-weight=\"bold\"" } else { "" };
    let colour = hexadecimal(style.fg);
    let baseline = MARGIN + y * CELL.1 + 14;
    let symbols: Vec<(u16, char)> = (x..).zip(symbols.chars()).collect();
    for word in symbols.chunk_by(|one, next| (one.1 == ' ') == (next.1 == ' ')) {
        let Some((column, _)) = word.first().filter(|(_, symbol)| *symbol != ' ') else { continue };
        let left = MARGIN + column * CELL.0;
        let length = word.len() * usize::from(CELL.0);
        let word = escaped(&word.iter().map(|(_, symbol)| symbol).collect::<String>());
        let _ = writeln!(
            out,
            "<text x=\"{left}\" y=\"{baseline}\" textLength=\"{length}\" \
             lengthAdjust=\"spacingAndGlyphs\" fill=\"{colour}\"{weight}>{word}</text>"
        );
    }
}

fn shapes(out: &mut String, x: u16, y: u16, cell: &Cell) {
    let (left, top) = (MARGIN + x * CELL.0, MARGIN + y * CELL.1);
    let colour = hexadecimal(cell.fg);
    let Some(symbol) = cell.symbol().chars().next() else { return };
    if let Some(path) = path(symbol) {
        let _ = writeln!(out, "<path d=\"M{left} {top}{path}\" stroke=\"{colour}\" fill=\"none\"/>");
    }
    for (column, row) in dots(symbol).into_iter().flatten() {
        let (cx, cy) = (f64::from(left) + 2.25 + 4.5 * column, f64::from(top) + 2.25 + 4.5 * row);
        let _ = writeln!(out, "<circle cx=\"{cx}\" cy=\"{cy}\" r=\"1.5\" fill=\"{colour}\"/>");
    }
}

/// The dots of a Braille pattern as columns and rows, in the order of Unicode's bits.
fn dots(symbol: char) -> Option<Vec<(f64, f64)>> {
    const PLACES: [(f64, f64); 8] =
        [(0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (1.0, 0.0), (1.0, 1.0), (1.0, 2.0), (0.0, 3.0), (1.0, 3.0)];
    let bits = u32::from(symbol).checked_sub(BRAILLE).filter(|bits| *bits < 256)?;
    let is_set = |&(bit, _): &(usize, (f64, f64))| bits & (1 << bit) != 0;
    Some(PLACES.into_iter().enumerate().filter(is_set).map(|(_, place)| place).collect())
}

/// The SVG path of a line character, relative to the corner of its cell.
const fn path(symbol: char) -> Option<&'static str> {
    Some(match symbol {
        '─' => "m0 9h9",
        '│' => "m4.5 0v18",
        '┌' => "m4.5 18v-9h4.5",
        '┐' => "m0 9h4.5v9",
        '└' => "m4.5 0v9h4.5",
        '┘' => "m0 9h4.5v-9",
        _ => return None,
    })
}

/// The colour of a terminal colour in the picture.
const fn hexadecimal(colour: Color) -> &'static str {
    match colour {
        Color::Red => "#f2777a",
        Color::Yellow => "#f0c674",
        Color::Green => "#8ccf7e",
        Color::Cyan => "#67c8c8",
        Color::Blue => "#6ba4ef",
        Color::Magenta => "#c792ea",
        Color::Gray => "#c0c5ce",
        Color::DarkGray => "#6b7480",
        _ => FOREGROUND,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::monitor::view::tests::watching;

    #[test]
    fn the_svg_contains_the_screen() {
        let picture = picture(&watching());
        assert!(picture.contains(">firmware<") && picture.contains(">moving<"), "{picture}");
        assert!(picture.matches("<circle").count() > 100, "the plot");
        assert!(picture.contains(&format!("fill=\"{}\"", hexadecimal(Color::Yellow))), "joint 2");
    }

    #[test]
    fn braille_dots_follow_unicode() {
        assert_eq!(dots('⠁'), Some(vec![(0.0, 0.0)]));
        assert_eq!(dots('⢀'), Some(vec![(1.0, 3.0)]));
        assert_eq!(dots('a'), None);
    }
}

//! The table and the things on it as text: one thing on each line, or with `;` between them.
//!
//! ```text
//!   # Lengths in mm and weights in g, in the frame of the arm: x to the right, y forward, z up.
//!   table -60                       the height of the table; without this line it is at the foot of the base
//!   tool cup                        a suction cup instead of the claws
//!   wall shelf 0 250 200 20 80      x, y, then width, depth and height
//!   cube red 30 40 0 220 15         edge, weight, x, y, and how far it is turned, in degrees
//!   cylinder can 40 60 100 -80 200  diameter, height, weight, x, y
//! ```
//!
//! A cube or a cylinder stands on the highest surface below it: the table, a wall, or a cube or cylinder of an earlier line.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::{self, Display, Formatter};
use core::str::FromStr;

use kinematics::geometry::BASE_HEIGHT;

use crate::thousandths::Thousandths;

/// A scene has at most this many walls, cubes and cylinders.
pub const MOST_OBJECTS: usize = 24;
/// A name has at most this many characters.
const LONGEST_NAME: usize = 16;
/// The largest coordinate of a place, in mm, in each direction from the base.
const FARTHEST: f64 = 1_000.0;
/// The least and the greatest length, in mm.
const SIZES: [f64; 2] = [5.0, 1_000.0];
/// The least and the greatest weight, in grams.
const WEIGHTS: [f64; 2] = [1.0, 1_000.0];

/// The tool at the end of the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Tool {
    /// Two fingers, moved by joint 7.
    #[default]
    Claws,
    /// A suction cup, which the vacuum pump evacuates.
    Cup,
}

/// A form and its size in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Form {
    /// A cube that stands on a face.
    Cube {
        /// The length of an edge, 5 to 1000.
        edge: f64,
    },
    /// A cylinder that stands upright.
    Cylinder {
        /// The diameter, 5 to 1000.
        diameter: f64,
        /// The distance from the foot to the top.
        height: f64,
    },
}

/// Something that can be gripped, pushed and dropped.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Item {
    /// The name: 1 to 16 letters, digits or `-`, different from all other names in the scene.
    pub name: String,
    /// The form and the size.
    pub form: Form,
    /// Its weight in grams.
    pub grams: u16,
    /// The initial position of its middle, seen from above: x and y in mm.
    pub at: [f64; 2],
    /// Its initial rotation about the vertical in degrees, anticlockwise seen from above.
    pub turn: f64,
}

/// A block that never moves. It stands on the table.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Block {
    /// The name, with the rules of [`Item::name`].
    pub name: String,
    /// The position of its middle, seen from above: x and y in mm.
    pub at: [f64; 2],
    /// Width along x, depth along y, and height, in mm.
    pub size: [f64; 3],
}

/// The table and the initial positions of the things on it.
///
/// ```
/// use arm_sim::scene::Scene;
///
/// let scene: Scene = "cube red 30 40 0 220; cube blue 30 40 60 220".parse()?;
/// assert_eq!(scene.items.len(), 2);
/// assert_eq!(scene.to_string().parse(), Ok(scene));
/// # Ok::<(), arm_sim::scene::SceneError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Scene {
    /// The height of the table: z in mm.
    pub table: f64,
    /// The tool at the end of the arm.
    pub tool: Tool,
    /// The walls. They never move.
    pub walls: Vec<Block>,
    /// The cubes and cylinders, which can be moved.
    pub items: Vec<Item>,
}

impl Default for Scene {
    /// An empty table.
    fn default() -> Self {
        Self { table: -BASE_HEIGHT, tool: Tool::Claws, walls: Vec::new(), items: Vec::new() }
    }
}

/// Why a text is not a scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line} of the scene: {reason}")]
pub struct SceneError {
    /// The number of the line, or of the part between `;`, from 1.
    pub line: usize,
    /// The rule that the line breaks, as a text for the user.
    pub reason: &'static str,
}

const KINDS: &str = "use table Z, tool claws, tool cup, wall NAME X Y WIDTH DEPTH HEIGHT, cube NAME EDGE GRAMS X Y \
                     [TURN] or cylinder NAME DIAMETER HEIGHT GRAMS X Y";
const NUMBER: &str = "a number is missing, or has more than three decimals";
const PLACE: &str = "a place is at most 1000 mm from the base";
const SIZE: &str = "a length is 5 to 1000 mm";
const WEIGHT: &str = "a weight is 1 to 1000 g, in whole grams";
const NAME: &str = "a name has 1 to 16 letters, digits or '-', and only one thing has it";
const MANY: &str = "a scene has at most 24 walls, cubes and cylinders";

impl FromStr for Scene {
    type Err = SceneError;

    fn from_str(text: &str) -> Result<Self, SceneError> {
        let mut scene = Self::default();
        for (line, number) in text.split(['\n', ';']).zip(1..) {
            let words = line.split('#').next().unwrap_or_default();
            let words: Vec<&str> = words.split_whitespace().collect();
            scene.add(&words).map_err(|reason| SceneError { line: number, reason })?;
        }
        Ok(scene)
    }
}

impl Scene {
    fn add(&mut self, words: &[&str]) -> Result<(), &'static str> {
        match *words {
            [] => {}
            ["table", z] => self.table = within(number(z)?, [-FARTHEST, FARTHEST], PLACE)?,
            ["tool", "claws"] => self.tool = Tool::Claws,
            ["tool", "cup"] => self.tool = Tool::Cup,
            ["wall", name, x, y, width, depth, height] => {
                let size = [size(width)?, size(depth)?, size(height)?];
                let wall = Block { name: self.name(name)?, at: [place(x)?, place(y)?], size };
                self.walls.push(wall);
            }
            ["cube", name, edge, grams, x, y] => self.add_item(name, cube(edge)?, grams, [x, y], "0")?,
            ["cube", name, edge, grams, x, y, turn] => {
                self.add_item(name, cube(edge)?, grams, [x, y], turn)?;
            }
            ["cylinder", name, diameter, height, grams, x, y] => {
                let form = Form::Cylinder { diameter: size(diameter)?, height: size(height)? };
                self.add_item(name, form, grams, [x, y], "0")?;
            }
            _ => return Err(KINDS),
        }
        if self.walls.len() + self.items.len() > MOST_OBJECTS { Err(MANY) } else { Ok(()) }
    }

    fn add_item(
        &mut self,
        name: &str,
        form: Form,
        grams: &str,
        [x, y]: [&str; 2],
        turn: &str,
    ) -> Result<(), &'static str> {
        within(number(grams)?, WEIGHTS, WEIGHT)?;
        let grams = grams.parse().map_err(|_| WEIGHT)?;
        let turn = within(number(turn)?, [-180.0, 180.0], "a turn is -180 to 180 degrees")?;
        let item = Item { name: self.name(name)?, form, grams, at: [place(x)?, place(y)?], turn };
        self.items.push(item);
        Ok(())
    }

    /// Checks a new name against the rules of [`Item::name`], and returns it.
    fn name(&self, name: &str) -> Result<String, &'static str> {
        let mut names =
            self.walls.iter().map(|wall| &wall.name).chain(self.items.iter().map(|item| &item.name));
        let is_good = name.chars().all(|letter| letter.is_alphanumeric() || letter == '-')
            && name.chars().count() <= LONGEST_NAME
            && names.all(|other| other != name);
        if is_good { Ok(name.into()) } else { Err(NAME) }
    }
}

fn number(word: &str) -> Result<f64, &'static str> {
    Thousandths::parse(word).map(|Thousandths(value)| f64::from(value) / 1_000.0).ok_or(NUMBER)
}

/// Converts a number of a scene to its text form, rounded to the nearest thousandth.
#[expect(
    clippy::cast_possible_truncation,
    reason = "numbers of a scene are small, and a part below a thousandth is none"
)]
const fn words(value: f64) -> Thousandths {
    Thousandths((value * 1_000.0 + if value < 0.0 { -0.5 } else { 0.5 }) as i32)
}

fn within(value: f64, [low, high]: [f64; 2], reason: &'static str) -> Result<f64, &'static str> {
    if (low..=high).contains(&value) { Ok(value) } else { Err(reason) }
}

fn place(word: &str) -> Result<f64, &'static str> {
    within(number(word)?, [-FARTHEST, FARTHEST], PLACE)
}

fn size(word: &str) -> Result<f64, &'static str> {
    within(number(word)?, SIZES, SIZE)
}

fn cube(edge: &str) -> Result<Form, &'static str> {
    Ok(Form::Cube { edge: size(edge)? })
}

impl Display for Scene {
    /// The scene on one line.
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        write!(out, "table {}", words(self.table))?;
        if self.tool == Tool::Cup {
            out.write_str("; tool cup")?;
        }
        for Block { name, at, size } in &self.walls {
            let ([x, y], [width, depth, height]) = (at.map(words), size.map(words));
            write!(out, "; wall {name} {x} {y} {width} {depth} {height}")?;
        }
        self.items.iter().try_for_each(|item| write!(out, "; {item}"))
    }
}

impl Display for Item {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let Self { name, form, grams, at, turn } = self;
        let ([x, y], turn) = (at.map(words), words(*turn));
        match *form {
            Form::Cube { edge } => write!(out, "cube {name} {} {grams} {x} {y} {turn}", words(edge)),
            Form::Cylinder { diameter, height } => {
                write!(out, "cylinder {name} {} {} {grams} {x} {y}", words(diameter), words(height))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn a_scene_is_printed_as_it_is_read() {
        let text = "table -40.5; tool cup; wall shelf 0 250 200 20 80; cube red 30 40 0 220 15; \
                    cylinder can 40 60 100 -80 200";
        let scene: Scene = text.parse().unwrap();
        assert_eq!(scene.to_string(), text);
        let lines = text.replace("; ", "  # a comment\n\n");
        assert_eq!(lines.parse(), Ok(scene));
        assert_eq!("".parse(), Ok(Scene::default()));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (line, reason) in [
            ("sphere ball 3 4 5", KINDS),
            ("table", KINDS),
            ("table high", NUMBER),
            ("table NaN", NUMBER),
            ("tool hook", KINDS),
            ("wall w 0 1001 10 10 10", PLACE),
            ("wall w 0 0 10 10 4", SIZE),
            ("cube red 30 0 0 200", WEIGHT),
            ("cube red 30 1.5 0 200", WEIGHT),
            ("table 1e2", NUMBER),
            ("cube a 30 40 0 200", NAME),
            ("cube with_underscore 30 40 0 200", NAME),
            ("cube red 30 40 0 200 270", "a turn is -180 to 180 degrees"),
            ("cylinder c 30 40 0 200", KINDS),
        ] {
            let text = alloc::format!("# first\ncube a 30 40 0 200\n{line}");
            assert_eq!(text.parse::<Scene>(), Err(SceneError { line: 3, reason }), "{line}");
        }
        let many: String = (0..25).map(|number| alloc::format!("cube c{number} 5 1 0 200\n")).collect();
        assert_eq!(many.parse::<Scene>(), Err(SceneError { line: 25, reason: MANY }));
    }
}

//! The colours of the scene and of the plots, for light and dark backgrounds.

/// A colour in sRGB: red, green and blue from 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

impl Rgb {
    /// Red, green and blue from 0 to 1.
    #[must_use]
    pub fn floats(self) -> [f32; 3] {
        let Self(red, green, blue) = self;
        [red, green, blue].map(|value| f32::from(value) / 255.0)
    }

    /// The colour in CSS: `#rrggbb`.
    #[must_use]
    pub fn css(self) -> String {
        let Self(red, green, blue) = self;
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

/// Whether the page is light or dark. It selects a [`Palette`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theme {
    /// A light background.
    #[default]
    Light,
    /// A dark background.
    Dark,
}

/// The colours of a theme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Palette {
    /// The background of the scene.
    pub background: Rgb,
    /// The table under the arm, the background of plots, and the rim of the tip's marker.
    pub table: Rgb,
    /// Lines of the grid in the scene and in plots, and walls without a colour in their name.
    pub grid: Rgb,
    /// Axes and text.
    pub text: Rgb,
    /// Shells of the arm.
    pub shell: Rgb,
    /// Servos and other dark parts.
    pub dark: Rgb,
    /// Shadow on the table.
    pub shadow: Rgb,
    /// The ghost of the arm, at its targets or at a moment of a time line.
    pub ghost: Rgb,
    /// The marker of the tip.
    pub tip: Rgb,
    /// A wanted position of the tip to which the arm does not go.
    pub unreachable: Rgb,
    /// Mixed into the colour of the part under the pointer.
    pub hover: Rgb,
    /// A driven joint without a problem.
    pub joint_ok: Rgb,
    /// A joint whose motor is off or damped.
    pub joint_limp: Rgb,
    /// A stalled joint; every joint if the arm does not tell which servo has a fault.
    pub joint_fault: Rgb,
    /// A joint whose servo does not answer.
    pub joint_missing: Rgb,
    /// Lines of joints 1 to 7 in plots, and things without a colour in their name.
    pub joints: [Rgb; 7],
}

const LIGHT: Palette = Palette {
    background: Rgb(238, 241, 245),
    table: Rgb(252, 253, 254),
    grid: Rgb(196, 204, 214),
    text: Rgb(58, 68, 82),
    shell: Rgb(250, 250, 252),
    dark: Rgb(64, 70, 80),
    shadow: Rgb(120, 130, 145),
    ghost: Rgb(40, 110, 230),
    tip: Rgb(214, 0, 140),
    unreachable: Rgb(200, 60, 0),
    hover: Rgb(255, 214, 0),
    joint_ok: Rgb(0, 124, 137),
    joint_limp: Rgb(104, 88, 196),
    joint_fault: Rgb(206, 22, 32),
    joint_missing: Rgb(110, 112, 116),
    joints: [
        Rgb(0, 94, 168),
        Rgb(196, 66, 0),
        Rgb(0, 122, 84),
        Rgb(160, 50, 140),
        Rgb(134, 100, 0),
        Rgb(16, 122, 160),
        Rgb(66, 66, 72),
    ],
};

const DARK: Palette = Palette {
    background: Rgb(20, 24, 30),
    table: Rgb(30, 36, 44),
    grid: Rgb(62, 72, 86),
    text: Rgb(200, 208, 220),
    shell: Rgb(214, 219, 226),
    dark: Rgb(84, 92, 104),
    shadow: Rgb(6, 8, 11),
    ghost: Rgb(110, 170, 255),
    tip: Rgb(255, 80, 190),
    unreachable: Rgb(255, 150, 60),
    hover: Rgb(255, 224, 70),
    joint_ok: Rgb(38, 184, 196),
    joint_limp: Rgb(166, 150, 255),
    joint_fault: Rgb(255, 92, 92),
    joint_missing: Rgb(140, 144, 150),
    joints: [
        Rgb(92, 178, 255),
        Rgb(255, 146, 76),
        Rgb(64, 206, 156),
        Rgb(236, 138, 220),
        Rgb(240, 206, 72),
        Rgb(112, 216, 244),
        Rgb(214, 218, 224),
    ],
};

impl Theme {
    /// The colours of the scene and of plots in this theme.
    #[must_use]
    pub const fn palette(self) -> &'static Palette {
        match self {
            Self::Light => &LIGHT,
            Self::Dark => &DARK,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance, as WCAG 2 defines it.
    fn luminance(colour: Rgb) -> f32 {
        let [red, green, blue] = colour
            .floats()
            .map(|value| if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) });
        0.2126 * red + 0.7152 * green + 0.0722 * blue
    }

    /// The contrast of two colours, as WCAG 2 defines it: 1 to 21.
    fn contrast(one: Rgb, other: Rgb) -> f32 {
        let (one, other) = (luminance(one), luminance(other));
        (one.max(other) + 0.05) / (one.min(other) + 0.05)
    }

    #[test]
    fn text_and_graphics_have_the_contrast_that_wcag_asks_for() {
        for theme in [Theme::Light, Theme::Dark] {
            let palette = theme.palette();
            for background in [palette.background, palette.table] {
                assert!(contrast(palette.text, background) >= 4.5, "{theme:?} text");
                let states =
                    [palette.joint_ok, palette.joint_limp, palette.joint_fault, palette.joint_missing];
                let marks = [palette.ghost, palette.tip, palette.unreachable];
                for colour in states.into_iter().chain(marks).chain(palette.joints) {
                    let found = contrast(colour, background);
                    assert!(found >= 3.0, "{theme:?} {colour:?} on {background:?}: {found}");
                }
            }
        }
    }

    #[test]
    fn a_colour_is_written_for_css() {
        assert_eq!(Rgb(1, 171, 255).css(), "#01abff");
        assert_eq!(Rgb(255, 0, 51).floats(), [1.0, 0.0, 0.2]);
    }
}

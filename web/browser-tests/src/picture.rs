//! Pictures of the page: decodes PNG files, counts pixels, and writes animations.

use std::fs;
use std::io::{BufWriter, Cursor};
use std::path::Path;

/// A picture without transparency.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Its width in pixels.
    pub width: usize,
    /// Its height in pixels.
    pub height: usize,
    /// Red, green, blue, row by row.
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Decodes a PNG file in RGB or RGBA with 8 bits each, and drops its transparency.
    #[must_use]
    pub fn decode(png: &[u8]) -> Self {
        let mut reader = png::Decoder::new(Cursor::new(png)).read_info().expect("a picture");
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut bytes).expect("pixels");
        let samples = info.color_type.samples();
        let pixels = bytes[..info.buffer_size()].chunks_exact(samples);
        let pixels = pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        Self { width: info.width as usize, height: info.height as usize, pixels }
    }

    /// The colour of a pixel. `x` and `y` count from 0 at the top left.
    #[must_use]
    pub fn at(&self, x: usize, y: usize) -> [u8; 3] {
        self.pixels[y * self.width + x]
    }

    /// The number of pixels that differ from another picture of the same size.
    #[must_use]
    pub fn differences(&self, other: &Self) -> usize {
        assert_eq!((self.width, self.height), (other.width, other.height));
        self.pixels.iter().zip(&other.pixels).filter(|(one, other)| one != other).count()
    }

    /// The number of pixels that meet a condition.
    #[must_use]
    pub fn count(&self, meets: impl Fn([u8; 3]) -> bool) -> usize {
        self.pixels.iter().filter(|&&pixel| meets(pixel)).count()
    }

    /// The places of all pixels that differ from a colour by at most this much in red, green and blue.
    pub fn places(&self, colour: [u8; 3], tolerance: u8) -> impl Iterator<Item = [f64; 2]> {
        let is_near =
            move |pixel: &[u8; 3]| pixel.iter().zip(colour).all(|(&a, b)| a.abs_diff(b) <= tolerance);
        let numbered = self.pixels.iter().enumerate().filter(move |(_, pixel)| is_near(pixel));
        numbered.map(|(index, _)| [(index % self.width) as f64 + 0.5, (index / self.width) as f64 + 0.5])
    }

    /// The number of pixels as in [`Self::places`] that are within `radius` pixels of a place.
    #[must_use]
    pub fn near(&self, colour: [u8; 3], tolerance: u8, [x, y]: [f64; 2], radius: f64) -> usize {
        let is_near = |place: &[f64; 2]| (place[0] - x).hypot(place[1] - y) <= radius;
        self.places(colour, tolerance).filter(is_near).count()
    }

    /// The number of different colours.
    #[must_use]
    pub fn colours(&self) -> usize {
        let mut colours = self.pixels.clone();
        colours.sort_unstable();
        colours.dedup();
        colours.len()
    }

    /// Every second pixel of every second row.
    #[must_use]
    pub fn half(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (2 * x, 2 * y)));
        let pixels = places.map(|(x, y)| self.at(x, y)).collect();
        Self { width, height, pixels }
    }
}

/// Writes pictures of one size as an animated PNG, which each browser shows.
pub fn write_animation(path: &Path, pictures: &[Picture], frames_per_second: u16) {
    let first = pictures.first().expect("a picture");
    let file = BufWriter::new(fs::File::create(path).expect("a file"));
    let size = |length| u32::try_from(length).expect("a size");
    let mut encoder = png::Encoder::new(file, size(first.width), size(first.height));
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    encoder.set_animated(size(pictures.len()), 0).expect("an animation");
    encoder.set_frame_delay(1, frames_per_second).expect("a delay");
    let mut writer = encoder.write_header().expect("a header");
    for picture in pictures {
        writer.write_image_data(picture.pixels.as_flattened()).expect("a frame");
    }
    writer.finish().expect("the end");
}

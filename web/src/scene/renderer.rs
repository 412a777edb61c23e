//! Draws a view with WebGL2.
//!
//! ```text
//!   table ─▶ grid ─▶ shadow (stencil: once a pixel) ─▶ things, arm ─▶ ghost (depth first, so that it is one layer) ─▶ markers
//! ```

use std::collections::HashMap;

use arm_model::{Body, Finish};
use glam::{Mat4, Vec3, Vec4};
use wasm_bindgen::JsValue;
use web_sys::{WebGl2RenderingContext as Gl, WebGlBuffer, WebGlProgram, WebGlVertexArrayObject};

use super::arm::{Angles, ArmMeshes, ArmPart, BODIES, tip_of, transforms};
use super::camera::Camera;
use super::lines::{LineEnd, Lines, TABLE};
use super::shaders;
use super::theme::{Palette, Rgb};
use super::things::triangles;
use super::view::View;

/// The number of floats of a corner of the arm: position, normal, index of the body, and finish.
const CORNER: usize = 8;
/// The direction to the lamp that casts the shadow.
const LAMP: Vec3 = Vec3::new(0.25, -0.2, 1.0);
/// The diameters of the markers of the tip, and of a wanted position to which the arm does not go, in CSS pixels. A hovered tip has
/// the larger one.
const TIP_SIZE: f32 = 13.0;
const WISH_SIZE: f32 = 18.0;
/// The radius of the table in mm, and the number of corners of its edge.
const TABLE_RADIUS: f32 = 520.0;
const TABLE_SIDES: u8 = 48;
/// The weight of the highlight's colour in a hovered part, from 0 to 1.
const HIGHLIGHT: f32 = 0.4;
/// The weight of a joint's colour in the shell of its part, from 0 to 1: for a joint that works, and for any other state.
const SHELL_WEIGHT: f32 = 0.12;
const SHELL_WEIGHT_ELSE: f32 = 0.4;

/// Programs and buffers of one graphics context.
pub struct Renderer {
    gl: Gl,
    arm: Layer,
    indices: i32,
    lines: Layer,
    markers: Layer,
}

/// A shader program, a buffer, and the layout of the buffer for the program.
struct Layer {
    program: WebGlProgram,
    buffer: WebGlBuffer,
    layout: WebGlVertexArrayObject,
}

/// The style in which the bodies of the arm are drawn.
struct Look {
    tint: Vec4,
    shading: f32,
    opacity: f32,
}

impl Renderer {
    /// Compiles the programs and uploads the meshes.
    ///
    /// # Errors
    /// The graphics driver reports an error, whose message is returned.
    pub fn new(gl: Gl, arm: &ArmMeshes) -> Result<Self, JsValue> {
        let layer =
            |vertex, fragment, attributes: &[(&str, i32)]| Layer::new(&gl, vertex, fragment, attributes);
        let of_arm = layer(
            shaders::ARM_VERTEX,
            shaders::ARM_FRAGMENT,
            &[("position", 3), ("normal", 3), ("kind", 2)],
        )?;
        let ends = [("position", 3), ("colour", 4)];
        let lines = layer(shaders::LINE_VERTEX, shaders::LINE_FRAGMENT, &ends)?;
        let markers = layer(shaders::MARKER_VERTEX, shaders::MARKER_FRAGMENT, &ends)?;
        let (corners, indices) = corners(arm);
        of_arm.upload(&gl, corners.as_flattened(), Gl::STATIC_DRAW);
        // The selected vertex array of the arm stores this binding.
        gl.bind_buffer(Gl::ELEMENT_ARRAY_BUFFER, gl.create_buffer().as_ref());
        let array = js_sys::Uint16Array::from(indices.as_slice());
        gl.buffer_data_with_array_buffer_view(Gl::ELEMENT_ARRAY_BUFFER, &array, Gl::STATIC_DRAW);
        gl.enable(Gl::CULL_FACE);
        gl.blend_func(Gl::ONE, Gl::ONE_MINUS_SRC_ALPHA);
        Ok(Self { arm: of_arm, indices: count(indices.len()), lines, markers, gl })
    }

    /// Draws a view. Width and height are in rendered pixels; `ratio` is rendered pixels per CSS pixel.
    pub fn draw(&self, view: &View, camera: &Camera, [width, height]: [i32; 2], ratio: f32) {
        let (gl, palette) = (&self.gl, view.theme.palette());
        gl.viewport(0, 0, width, height);
        let [red, green, blue] = palette.background.floats();
        gl.clear_color(red, green, blue, 1.0);
        gl.clear(Gl::COLOR_BUFFER_BIT | Gl::DEPTH_BUFFER_BIT | Gl::STENCIL_BUFFER_BIT);
        let projection = camera.view_projection();
        let lines = Lines::of(view, camera);
        self.blended(|| {
            self.draw_lines(Gl::TRIANGLES, &table(palette), projection);
            self.draw_lines(Gl::LINES, &lines.ground, projection);
            self.draw_shadow(view, palette, projection);
        });
        let own = Look { tint: Vec4::ZERO, shading: 1.0, opacity: 1.0 };
        gl.enable(Gl::DEPTH_TEST);
        self.draw_lines(Gl::TRIANGLES, &triangles(&view.things, palette), projection);
        self.use_arm(view, palette);
        self.draw_bodies(view.measured, projection, &own);
        if let Some(ghost) = view.ghost() {
            self.draw_ghost(ghost, palette, projection);
        }
        gl.disable(Gl::DEPTH_TEST);
        self.blended(|| self.draw_lines(Gl::LINES, &lines.over, projection));
        self.draw_markers(view, palette, projection, ratio);
    }

    fn blended(&self, draw: impl FnOnce()) {
        self.gl.enable(Gl::BLEND);
        draw();
        self.gl.disable(Gl::BLEND);
    }

    /// Selects the arm's program, and sets the colours of a view.
    fn use_arm(&self, view: &View, palette: &Palette) {
        let (gl, arm) = (&self.gl, &self.arm);
        arm.select(gl);
        arm.set_colour(gl, "shell", palette.shell);
        arm.set_colour(gl, "dark", palette.dark);
        arm.set_colour(gl, "highlight", palette.hover);
        let accents = Body::ALL.map(|body| accent(view, palette, ArmPart::of(body)));
        let highlights = Body::ALL.map(|body| {
            let part = ArmPart::of(body);
            if view.hovered == Some(part) && part != ArmPart::Base { HIGHLIGHT } else { 0.0 }
        });
        gl.uniform1fv_with_f32_array(arm.uniform(gl, "highlights").as_ref(), &highlights);
        gl.uniform4fv_with_f32_array(arm.uniform(gl, "accents").as_ref(), accents.as_flattened());
    }

    fn draw_bodies(&self, angles: Angles, projection: Mat4, look: &Look) {
        let (gl, arm) = (&self.gl, &self.arm);
        let mut bodies = [0.0; BODIES * 16];
        for (place, (_, transform)) in bodies.as_chunks_mut::<16>().0.iter_mut().zip(transforms(angles)) {
            *place = Mat4::from(transform).to_cols_array();
        }
        arm.set_projection(gl, projection);
        gl.uniform_matrix4fv_with_f32_array(arm.uniform(gl, "bodies").as_ref(), false, &bodies);
        gl.uniform4fv_with_f32_array(arm.uniform(gl, "tint").as_ref(), &look.tint.to_array());
        gl.uniform1f(arm.uniform(gl, "shading").as_ref(), look.shading);
        gl.uniform1f(arm.uniform(gl, "opacity").as_ref(), look.opacity);
        gl.draw_elements_with_i32(Gl::TRIANGLES, self.indices, Gl::UNSIGNED_SHORT, 0);
    }

    /// Draws the arm flattened onto the table along the direction of the lamp. The stencil darkens a pixel only once.
    fn draw_shadow(&self, view: &View, palette: &Palette, projection: Mat4) {
        let gl = &self.gl;
        let slope = -LAMP.truncate() / LAMP.z;
        let flatten = Mat4::from_cols(
            Vec4::X,
            Vec4::Y,
            Vec4::new(slope.x, slope.y, 0.0, 0.0),
            Vec4::new(-slope.x * TABLE, -slope.y * TABLE, TABLE, 1.0),
        );
        let [red, green, blue] = palette.shadow.floats();
        let look = Look { tint: Vec4::new(red, green, blue, 1.0), shading: 0.0, opacity: 0.35 };
        gl.enable(Gl::STENCIL_TEST);
        gl.stencil_func(Gl::EQUAL, 0, 1);
        gl.stencil_op(Gl::KEEP, Gl::KEEP, Gl::INCR);
        self.use_arm(view, palette);
        self.draw_bodies(view.measured, projection * flatten, &look);
        gl.disable(Gl::STENCIL_TEST);
    }

    /// Draws the ghost in two passes: first only its depth, then only its nearest surfaces, so that it is one translucent layer.
    /// The polygon offset moves it back, so that the arm stays visible where both coincide.
    fn draw_ghost(&self, angles: Angles, palette: &Palette, projection: Mat4) {
        let gl = &self.gl;
        let [red, green, blue] = palette.ghost.floats();
        let look = Look { tint: Vec4::new(red, green, blue, 0.85), shading: 0.7, opacity: 0.4 };
        gl.enable(Gl::POLYGON_OFFSET_FILL);
        gl.polygon_offset(2.0, 8.0);
        gl.color_mask(false, false, false, false);
        self.draw_bodies(angles, projection, &look);
        gl.color_mask(true, true, true, true);
        gl.depth_func(Gl::EQUAL);
        self.blended(|| self.draw_bodies(angles, projection, &look));
        gl.depth_func(Gl::LESS);
        gl.disable(Gl::POLYGON_OFFSET_FILL);
    }

    fn draw_lines(&self, mode: u32, ends: &[LineEnd], projection: Mat4) {
        let (gl, lines) = (&self.gl, &self.lines);
        lines.select(gl);
        lines.set_projection(gl, projection);
        lines.upload(gl, ends.as_flattened(), Gl::DYNAMIC_DRAW);
        gl.draw_arrays(mode, 0, count(ends.len()));
    }

    fn draw_markers(&self, view: &View, palette: &Palette, projection: Mat4, ratio: f32) {
        let (gl, markers) = (&self.gl, &self.markers);
        markers.select(gl);
        markers.set_projection(gl, projection);
        let marker = |at: Vec3, colour: Rgb, size: f32, is_hollow: bool| {
            let ([x, y, z], [red, green, blue]) = (at.to_array(), colour.floats());
            markers.upload(gl, &[x, y, z, red, green, blue, 1.0], Gl::DYNAMIC_DRAW);
            gl.uniform1f(markers.uniform(gl, "size").as_ref(), size * ratio);
            gl.uniform1f(markers.uniform(gl, "hollow").as_ref(), if is_hollow { 1.0 } else { 0.0 });
            markers.set_colour(gl, "rim", palette.table);
            gl.draw_arrays(Gl::POINTS, 0, 1);
        };
        if let Some(wish) = view.unreachable {
            marker(wish, palette.unreachable, WISH_SIZE, true);
        }
        let size = if view.hovered == Some(ArmPart::Tip) { WISH_SIZE } else { TIP_SIZE };
        marker(tip_of(view.measured), palette.tip, size, false);
    }
}

impl Layer {
    fn new(gl: &Gl, vertex: &str, fragment: &str, attributes: &[(&str, i32)]) -> Result<Self, JsValue> {
        let program = gl.create_program().ok_or("no graphics program")?;
        for (kind, source) in [(Gl::VERTEX_SHADER, vertex), (Gl::FRAGMENT_SHADER, fragment)] {
            let shader = gl.create_shader(kind).ok_or("no shader")?;
            gl.shader_source(&shader, source);
            gl.compile_shader(&shader);
            gl.attach_shader(&program, &shader);
        }
        for (place, (name, _)) in (0..).zip(attributes) {
            gl.bind_attrib_location(&program, place, name);
        }
        gl.link_program(&program);
        if !gl.get_program_parameter(&program, Gl::LINK_STATUS).is_truthy() {
            return Err(gl.get_program_info_log(&program).unwrap_or_default().into());
        }
        let buffer = gl.create_buffer().ok_or("no buffer")?;
        let layout = gl.create_vertex_array().ok_or("no vertex array")?;
        let layer = Self { program, buffer, layout };
        layer.select(gl);
        let stride: i32 = attributes.iter().map(|(_, numbers)| numbers * 4).sum();
        let mut offset = 0;
        for (place, (_, numbers)) in (0..).zip(attributes) {
            gl.enable_vertex_attrib_array(place);
            gl.vertex_attrib_pointer_with_i32(place, *numbers, Gl::FLOAT, false, stride, offset);
            offset += numbers * 4;
        }
        Ok(layer)
    }

    fn select(&self, gl: &Gl) {
        gl.use_program(Some(&self.program));
        gl.bind_vertex_array(Some(&self.layout));
        gl.bind_buffer(Gl::ARRAY_BUFFER, Some(&self.buffer));
    }

    fn upload(&self, gl: &Gl, numbers: &[f32], usage: u32) {
        self.select(gl);
        let numbers = js_sys::Float32Array::from(numbers);
        gl.buffer_data_with_array_buffer_view(Gl::ARRAY_BUFFER, &numbers, usage);
    }

    fn uniform(&self, gl: &Gl, name: &str) -> Option<web_sys::WebGlUniformLocation> {
        gl.get_uniform_location(&self.program, name)
    }

    fn set_projection(&self, gl: &Gl, projection: Mat4) {
        let place = self.uniform(gl, "view_projection");
        gl.uniform_matrix4fv_with_f32_array(place.as_ref(), false, &projection.to_cols_array());
    }

    fn set_colour(&self, gl: &Gl, name: &str, colour: Rgb) {
        let [red, green, blue] = colour.floats();
        gl.uniform3f(self.uniform(gl, name).as_ref(), red, green, blue);
    }
}

/// The colour of a part's joint, and its weight in the part's shell. The weight is larger for a joint that does not work.
fn accent(view: &View, palette: &Palette, part: ArmPart) -> [f32; 4] {
    let colour = match part {
        ArmPart::Joint(joint) => view.colours.get(usize::from(joint).wrapping_sub(1)).copied(),
        ArmPart::Base | ArmPart::Tip => None,
    };
    let [red, green, blue] = colour.unwrap_or(palette.shell).floats();
    let weight = if colour == Some(palette.joint_ok) { SHELL_WEIGHT } else { SHELL_WEIGHT_ELSE };
    [red, green, blue, weight]
}

/// The distinct corners of the arm in the layout of the arm's program, and their indices in the order of the triangles. So a
/// corner that several triangles share is stored only once.
fn corners(arm: &ArmMeshes) -> (Vec<[f32; CORNER]>, Vec<u16>) {
    let (mut corners, mut indices, mut known) = (Vec::new(), Vec::new(), HashMap::new());
    for (number, (_, mesh)) in (0_u8..).zip(arm.meshes()) {
        for ((&[x, y, z], &[u, v, w]), finish) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.finishes)
        {
            let finish = match finish {
                Finish::Shell => 0.0,
                Finish::Dark => 1.0,
                Finish::Accent => 2.0,
            };
            let corner: [f32; CORNER] = [x, y, z, u, v, w, f32::from(number), finish];
            let index = *known.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                corners.push(corner);
                u16::try_from(corners.len() - 1).unwrap_or_default()
            });
            indices.push(index);
        }
    }
    (corners, indices)
}

/// The table: a disc that fades at its edge.
fn table(palette: &Palette) -> Vec<LineEnd> {
    let [red, green, blue] = palette.table.floats();
    let corner = |radius: f32, side: u8, opacity| {
        let angle = f32::from(side) * std::f32::consts::TAU / f32::from(TABLE_SIDES);
        let (sine, cosine) = angle.sin_cos();
        [radius * cosine, radius * sine, TABLE, red, green, blue, opacity]
    };
    let inner = TABLE_RADIUS * 0.7;
    let sides = (0..TABLE_SIDES).flat_map(|side| {
        let (a, b) = (corner(inner, side, 1.0), corner(inner, side + 1, 1.0));
        let (c, d) = (corner(TABLE_RADIUS, side + 1, 0.0), corner(TABLE_RADIUS, side, 0.0));
        [corner(0.0, 0, 1.0), a, b, a, d, c, a, c, b]
    });
    sides.collect()
}

/// Converts a number of corners to the type that WebGL needs.
fn count(corners: usize) -> i32 {
    i32::try_from(corners).unwrap_or(i32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_corners_are_kept_once_and_have_an_index() {
        let arm = ArmMeshes::default();
        let (corners, indices) = corners(&arm);
        let positions: Vec<[f32; 3]> =
            arm.meshes().iter().flat_map(|(_, mesh)| mesh.positions.iter().copied()).collect();
        assert_eq!(indices.len(), positions.len());
        assert!(
            corners.len() < usize::from(u16::MAX) && corners.len() * 2 < indices.len(),
            "{}",
            corners.len()
        );
        for (index, position) in indices.into_iter().zip(positions) {
            assert_eq!(corners[usize::from(index)][..3], position);
        }
    }
}

//! The scene on a canvas.

use std::cell::Cell;
use std::rc::Rc;

use glam::{Vec2, Vec3};
use wasm_bindgen::closure::Closure;
use wasm_bindgen::{JsCast, JsValue};
use web_sys::{Event, HtmlCanvasElement, WebGl2RenderingContext as Gl, WebGlContextAttributes};

use super::arm::{Angles, ArmMeshes, ArmPart};
use super::camera::Camera;
use super::pointer::{self, Button, Pointer, SceneEvent};
use super::renderer::Renderer;
use super::view::View;

/// The parameter of the extension `WEBGL_debug_renderer_info` for the name of the graphics processor.
const UNMASKED_RENDERER: u32 = 0x9246;
/// Rendered pixels per CSS pixel on a graphics processor. The browser scales the picture to the screen, which smooths the edges.
const SMOOTH_RATIO: f32 = 2.0;

/// The arm on a canvas: picture, camera and pointers.
pub struct ArmScene {
    canvas: HtmlCanvasElement,
    gl: Gl,
    arm: ArmMeshes,
    camera: Camera,
    pointer: Pointer,
    /// Rendered pixels per CSS pixel.
    ratio: f32,
    renderer: Renderer,
    /// The last picture; `None` if the next one has to be drawn in any case.
    drawn: Option<Picture>,
    /// Set when the browser has restored a lost graphics context.
    is_restored: Rc<Cell<bool>>,
}

/// Everything that determines a picture: equal values give equal pictures.
#[derive(Clone, Debug, PartialEq)]
struct Picture {
    view: View,
    camera: Camera,
    pixels: [u32; 2],
}

impl ArmScene {
    /// Prepares the graphics of a canvas.
    ///
    /// # Errors
    /// The browser has no WebGL2, or the graphics driver reports an error.
    pub fn new(canvas: HtmlCanvasElement) -> Result<Self, JsValue> {
        let gl = context(&canvas)?.ok_or("this browser has no WebGL2")?;
        let ratio = pixel_ratio(&gl)?;
        let arm = ArmMeshes::default();
        let renderer = Renderer::new(gl.clone(), &arm)?;
        let is_restored = watch_context(&canvas)?;
        let (camera, pointer) = (Camera::default(), Pointer::default());
        Ok(Self { canvas, gl, arm, camera, pointer, ratio, renderer, drawn: None, is_restored })
    }

    /// Draws a view. Returns false without drawing if the picture equals the last one, or while the graphics context is lost.
    ///
    /// # Errors
    /// The graphics driver reports an error after the browser has restored a lost graphics context.
    pub fn draw(&mut self, view: &View) -> Result<bool, JsValue> {
        if self.is_restored.take() {
            self.renderer = Renderer::new(self.gl.clone(), &self.arm)?;
            self.drawn = None;
        }
        self.resize();
        let pixels = [self.canvas.width(), self.canvas.height()];
        let picture = Picture { view: view.clone(), camera: self.camera, pixels };
        if self.gl.is_context_lost() || self.drawn.as_ref() == Some(&picture) {
            return Ok(false);
        }
        let size = pixels.map(|length| i32::try_from(length).unwrap_or(i32::MAX));
        self.renderer.draw(view, &self.camera, size, self.ratio);
        self.drawn = Some(picture);
        Ok(true)
    }

    /// Projects a point of the arm's frame, in mm, to CSS pixels from the top left of the canvas. `None` as for
    /// [`Camera::project`].
    #[must_use]
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        self.camera.project(point)
    }

    /// The part of an arm with these angles at a point of the canvas, in CSS pixels from its top left.
    #[must_use]
    pub fn pick(&self, x: f32, y: f32, angles: Angles) -> Option<ArmPart> {
        Pointer::part_at(&self.arm, &self.camera, angles, Vec2::new(x, y))
    }

    /// The camera, so that the caller can move it.
    pub const fn camera_mut(&mut self) -> &mut Camera {
        &mut self.camera
    }

    /// Is a joint or the tip being dragged?
    #[must_use]
    pub const fn is_dragging(&self) -> bool {
        self.pointer.is_dragging()
    }

    /// Handles a pointer that went down. The position is in CSS pixels from the top left of the canvas; `angles` are the measured
    /// ones, in degrees.
    pub fn pointer_down(
        &mut self,
        id: i32,
        [x, y]: [f32; 2],
        button: Button,
        angles: Angles,
    ) -> Option<SceneEvent> {
        self.pointer.down((id, Vec2::new(x, y), button), &self.arm, &self.camera, angles)
    }

    /// Handles a pointer that moved. Position and angles are as for [`Self::pointer_down`].
    pub fn pointer_moved(&mut self, id: i32, [x, y]: [f32; 2], angles: Angles) -> Option<SceneEvent> {
        self.pointer.moved((id, Vec2::new(x, y)), &self.arm, &mut self.camera, angles)
    }

    /// Handles a pointer that went up or was cancelled.
    pub fn pointer_up(&mut self, id: i32) -> Option<SceneEvent> {
        self.pointer.up(id)
    }

    /// Handles a pointer that left the canvas without being down.
    pub fn pointer_left(&mut self) -> Option<SceneEvent> {
        self.pointer.left()
    }

    /// Zooms by a turn of the wheel, in CSS pixels; a positive number moves the camera away.
    pub fn wheel(&mut self, pixels: f32) {
        pointer::wheel(&mut self.camera, pixels);
    }

    /// Handles a key while the canvas has the focus. `key` is `KeyboardEvent.key`. Returns false if the key has no effect.
    pub fn key(&mut self, key: &str, shift: bool) -> bool {
        pointer::key(&mut self.camera, key, shift)
    }

    /// Fits the size of the canvas in pixels to its size on the page.
    #[expect(clippy::cast_possible_truncation, reason = "sizes of a screen, at most thousands")]
    #[expect(clippy::cast_sign_loss, reason = "sizes are positive")]
    #[expect(clippy::cast_precision_loss, reason = "sizes of a screen, at most thousands")]
    fn resize(&mut self) {
        let size =
            [self.canvas.client_width(), self.canvas.client_height()].map(|length| length.max(1) as f32);
        let [width, height] = size.map(|length| (length * self.ratio).round() as u32);
        // Setting the width or height erases the picture, even if the value does not change.
        if self.canvas.width() != width {
            self.canvas.set_width(width);
        }
        if self.canvas.height() != height {
            self.canvas.set_height(height);
        }
        self.camera.resize(size[0], size[1]);
    }
}

/// The WebGL2 context of a canvas; `None` if the browser has no WebGL2. WebGL's antialiasing would double the time of software
/// rendering. Instead, pictures are drawn larger on a graphics processor: see [`SMOOTH_RATIO`].
fn context(canvas: &HtmlCanvasElement) -> Result<Option<Gl>, JsValue> {
    let attributes = WebGlContextAttributes::new();
    attributes.set_alpha(false);
    attributes.set_stencil(true);
    attributes.set_antialias(false);
    let context = canvas.get_context_with_context_options("webgl2", &attributes)?;
    context.map(|context| context.dyn_into::<Gl>().map_err(JsValue::from)).transpose()
}

/// Chooses the number of rendered pixels per CSS pixel: 1 for software rendering.
fn pixel_ratio(gl: &Gl) -> Result<f32, JsValue> {
    // A browser may hide the name of the graphics processor. Then assume a graphics processor.
    gl.get_extension("WEBGL_debug_renderer_info")?;
    let name = gl.get_parameter(UNMASKED_RENDERER)?.as_string().unwrap_or_default().to_ascii_lowercase();
    let is_software =
        ["swiftshader", "llvmpipe", "software", "basic render"].iter().any(|known| name.contains(known));
    Ok(if is_software { 1.0 } else { SMOOTH_RATIO })
}

/// Asks the browser to restore the graphics context whenever it is lost. The returned flag becomes true when it was restored.
fn watch_context(canvas: &HtmlCanvasElement) -> Result<Rc<Cell<bool>>, JsValue> {
    let is_restored = Rc::new(Cell::new(false));
    let lost = Closure::<dyn Fn(Event)>::new(|event: Event| event.prevent_default());
    canvas.add_event_listener_with_callback("webglcontextlost", lost.as_ref().unchecked_ref())?;
    let flag = Rc::clone(&is_restored);
    let restored = Closure::<dyn Fn()>::new(move || flag.set(true));
    canvas.add_event_listener_with_callback("webglcontextrestored", restored.as_ref().unchecked_ref())?;
    // The listeners have to live as long as the canvas, which lives as long as the page.
    lost.forget();
    restored.forget();
    Ok(is_restored)
}

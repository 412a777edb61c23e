//! The page in a browser: connects sources, client, scene and panels.
//!
//! ```text
//!   source ──▶ client ──▶ ArmState ──▶ scene, panels
//!     ▲           ▲
//!     └── bytes ──┴── events of a person
//! ```

mod dom;
mod events;
mod panels;

use std::cell::RefCell;
use std::rc::Rc;

use glam::Vec3;
use kinematics::forward;
use protocol_core::time::Instant;
use wasm_bindgen::prelude::{Closure, wasm_bindgen};
use wasm_bindgen::{JsCast, JsValue};
use web_sys::CanvasRenderingContext2d;

use crate::arm_state::ArmState;
use crate::client::Client;
use crate::movement::{Player, Recorder};
use crate::plots::{History, Plot, Quantity, Sample, draw};
use crate::scene::{Part, Rgb, Scene, Theme, View};
use crate::source::simulator::SimulatedSource;
use crate::source::{LineState, Source};
use crate::texts::Language;
use dom::Dom;

/// Longer pauses of the browser, as in a tab in the background, let no more virtual time pass: 100 ms.
const LONGEST_FRAME_MS: f64 = 100.0;
/// At high speed the client takes part this often, in milliseconds of virtual time: well within the watchdog of a movement that is
/// played.
const STEP_MS: f64 = 20.0;
/// How long the simulation may compute in each frame, in milliseconds, so that 30 pictures a second remain.
const FRAME_BUDGET_MS: f64 = 24.0;
/// How long plots reach back, in seconds.
const PLOT_SECONDS: f64 = 10.0;

/// Where the arm is.
enum Line {
    Simulated(Box<SimulatedSource>),
    Remote(Box<dyn Source>),
}

impl Line {
    fn source(&mut self) -> &mut dyn Source {
        match self {
            Self::Simulated(source) => source.as_mut(),
            Self::Remote(source) => source.as_mut(),
        }
    }
}

/// The page.
pub(crate) struct App {
    dom: Dom,
    line: Line,
    client: Client,
    /// `None` where the browser has no WebGL2.
    scene: Option<Scene>,
    plot: CanvasRenderingContext2d,
    history: History,
    quantity: Quantity,
    language: Language,
    /// Of virtual time; 0 is a pause.
    speed: f64,
    /// The time of the last frame, in the browser's milliseconds.
    last_frame: f64,
    shown_round: u64,
    frames: u32,
    hovered: Option<Part>,
    unreachable: Option<Vec3>,
    /// A joint of a limp arm that the pointer holds.
    hand: Option<u8>,
    recorder: Option<Recorder>,
    player: Option<Player>,
    recording: Option<String>,
    tour_step: usize,
}

thread_local! {
    /// The page is a single one. Handlers of the browser need it after `start` has returned.
    static APP: RefCell<Option<Rc<RefCell<App>>>> = const { RefCell::new(None) };
}

/// Does something with the page, unless it is busy: a handler never runs inside another.
fn with_app<T>(act: impl FnOnce(&mut App) -> T) -> Option<T> {
    let app = APP.with_borrow(Clone::clone)?;
    let mut app = app.try_borrow_mut().ok()?;
    Some(act(&mut app))
}

/// Starts the page.
///
/// # Errors
/// The page lacks an element.
#[wasm_bindgen(start)]
pub fn start() -> Result<(), JsValue> {
    let dom = Dom::of_window()?;
    let app = App::new(dom.clone())?;
    APP.set(Some(Rc::new(RefCell::new(app))));
    events::listen(&dom)?;
    with_app(|app| {
        app.set_language(app.language);
        app.show_first_arm();
    });
    request_frames()
}

/// Lets the browser call us before each picture.
fn request_frames() -> Result<(), JsValue> {
    type Callback = Closure<dyn FnMut(f64)>;
    let callback: Rc<RefCell<Option<Callback>>> = Rc::default();
    let again = Rc::clone(&callback);
    *callback.borrow_mut() = Some(Closure::new(move |time| {
        with_app(|app| app.frame(time));
        if let Some(callback) = again.borrow().as_ref() {
            // The window is there: it has just called.
            let _ = request_frame(callback);
        }
    }));
    callback.borrow().as_ref().map_or(Ok(()), request_frame)
}

fn request_frame(callback: &Closure<dyn FnMut(f64)>) -> Result<(), JsValue> {
    let window = web_sys::window().ok_or("no window")?;
    window.request_animation_frame(callback.as_ref().unchecked_ref()).map(|_| ())
}

/// The plot is drawn by the processor: a software renderer of the graphics processor takes seconds for it while the page scrolls.
fn plot_context(dom: &Dom) -> Result<CanvasRenderingContext2d, JsValue> {
    let options = js_sys::Object::new();
    js_sys::Reflect::set(&options, &"willReadFrequently".into(), &true.into())?;
    let context = dom.canvas("plot")?.get_context_with_context_options("2d", &options)?;
    Ok(context.ok_or("no 2D canvas")?.unchecked_into())
}

/// The browser's clock, in milliseconds.
fn browser_now() -> f64 {
    web_sys::window().and_then(|window| window.performance()).map_or(0.0, |clock| clock.now())
}

impl App {
    fn new(dom: Dom) -> Result<Self, JsValue> {
        let tag = web_sys::window().and_then(|window| window.navigator().language());
        let language = Language::of_tag(&tag.unwrap_or_default());
        let scene = Scene::new(dom.canvas("scene")?);
        if let Err(reason) = &scene {
            panels::notice(&dom, &format!("{} {reason:?}", language.text("no-picture")));
        }
        let plot = plot_context(&dom)?;
        panels::build(&dom)?;
        Ok(Self {
            dom,
            line: Line::Simulated(Box::default()),
            client: Client::default(),
            scene: scene.ok(),
            plot,
            history: History::new(PLOT_SECONDS),
            quantity: Quantity::Angle,
            language,
            speed: 1.0,
            last_frame: browser_now(),
            shown_round: 0,
            frames: 0,
            hovered: None,
            unreachable: None,
            hand: None,
            recorder: None,
            player: None,
            recording: None,
            tour_step: 0,
        })
    }

    /// The clock of the arm: virtual for a simulated one.
    fn now(&self) -> Instant {
        match &self.line {
            Line::Simulated(source) => source.now(),
            Line::Remote(_) => Instant::from_micros(whole(browser_now() * 1e3)),
        }
    }

    /// Before each picture: bytes, time, then the picture.
    fn frame(&mut self, time: f64) {
        let elapsed = (time - self.last_frame).clamp(0.0, LONGEST_FRAME_MS);
        self.last_frame = time;
        let until = browser_now() + FRAME_BUDGET_MS;
        let mut rest = if matches!(self.line, Line::Simulated(_)) { elapsed * self.speed } else { 0.0 };
        loop {
            let step = rest.min(STEP_MS);
            self.exchange(step, until);
            rest -= step;
            if rest <= 0.0 || browser_now() >= until {
                break;
            }
        }
        self.show();
        self.frames = self.frames.wrapping_add(1);
    }

    /// Sends what is due, lets virtual time pass, and takes what the arm has sent.
    fn exchange(&mut self, virtual_ms: f64, until: f64) {
        let now = self.now();
        self.play(now);
        let bytes = self.client.poll(now);
        self.line.source().send(&bytes);
        if let Line::Simulated(source) = &mut self.line {
            source.advance(virtual_ms * 1e3, || browser_now() < until);
        }
        let bytes = self.line.source().receive();
        let now = self.now();
        self.client.receive(now, &bytes);
        if self.client.rounds() != self.shown_round {
            self.shown_round = self.client.rounds();
            self.new_state(now);
        }
    }

    fn play(&mut self, now: Instant) {
        let Some(mut player) = self.player.take() else { return };
        if player.poll(now, &mut self.client) {
            self.player = Some(player);
        }
    }

    /// The registers are new.
    #[expect(clippy::cast_precision_loss, reason = "times of years are exact enough")]
    fn new_state(&mut self, now: Instant) {
        let state = self.client.state();
        let vacuum = self.client.registers().byte(&sevenbot::map::VACUUM_PUMP) != 0;
        if let Some(recorder) = &mut self.recorder {
            recorder.add(now, &state, vacuum);
        }
        let time = now.as_micros() as f64 / 1e6;
        let (angles, loads, velocities) = (state.angles(), state.loads, state.velocities);
        self.history.push(Sample { time, angles, loads, velocities });
    }

    fn theme(&self) -> Theme {
        let query =
            web_sys::window().and_then(|window| window.match_media("(prefers-color-scheme: dark)").ok()?);
        if query.is_some_and(|query| query.matches()) { Theme::Dark } else { Theme::Light }
    }

    fn show(&mut self) {
        let (state, theme) = (self.client.state(), self.theme());
        let view = View {
            measured: state.angles(),
            targets: self.client.is_connected().then_some(state.targets),
            colours: colours(&state, theme),
            unreachable: self.unreachable,
            hovered: self.hovered,
            theme,
        };
        if let Some(scene) = &mut self.scene
            && let Err(reason) = scene.draw(&view)
        {
            panels::notice(&self.dom, &format!("{reason:?}"));
        }
        self.show_plot(theme);
        panels::show(self, &state);
    }

    fn show_plot(&self, theme: Theme) {
        let Some(canvas) = self.plot.canvas() else { return };
        let ratio = web_sys::window().map_or(1.0, |window| window.device_pixel_ratio());
        let size = [canvas.client_width(), canvas.client_height()].map(f64::from);
        let [width, height] = size.map(|length| u32::try_from(whole(length * ratio)).unwrap_or(0));
        if [canvas.width(), canvas.height()] != [width, height] {
            canvas.set_width(width);
            canvas.set_height(height);
        }
        let (name, unit) = match self.quantity {
            Quantity::Angle => ("angle", "°"),
            Quantity::Load => ("load", "%"),
            Quantity::Velocity => ("velocity", "°/s"),
        };
        let title = format!("{} ({unit})", self.language.text(name));
        let (quantity, shown) = (self.quantity, [true; 7]);
        let plot = Plot { quantity, title: &title, seconds: "s", shown, theme, size, ratio };
        // Only an invalid context is refused.
        let _ = draw(&self.plot, &plot, &self.history);
    }

    fn set_language(&mut self, language: Language) {
        self.language = language;
        self.dom.translate(language);
        self.show_tour();
    }

    /// Changes to another arm: everything that belonged to the last one ends.
    fn set_line(&mut self, line: Line) {
        (self.line, self.client) = (line, Client::default());
        (self.shown_round, self.hand, self.unreachable) = (0, None, None);
        (self.recorder, self.player) = (None, None);
        self.history = History::new(PLOT_SECONDS);
        let is_simulated = matches!(self.line, Line::Simulated(_));
        self.dom.set_hidden("simulator", !is_simulated);
        panels::end_notice(&self.dom);
    }

    fn line_state(&mut self) -> LineState {
        self.line.source().state()
    }
}

/// The colour of each joint: what is wrong with it comes first.
fn colours(state: &ArmState, theme: Theme) -> [Rgb; 7] {
    let palette = theme.palette();
    std::array::from_fn(|index| {
        if state.missing >> index & 1 == 1 {
            palette.joint_missing
        } else if state.faults & sevenbot::map::fault::SERVO_BUS != 0 && state.missing == 0 {
            palette.joint_fault
        } else if state.motor_state != sevenbot::map::motor_state::SERVO {
            palette.joint_limp
        } else {
            palette.joint_ok
        }
    })
}

/// The tip of the arm in mm.
fn tip(angles: [f32; 7]) -> [f64; 3] {
    let [one, two, three, four, five, six, _] = angles.map(f64::from);
    let tip = forward([one, two, three, four, five, six]).hand.tip;
    [tip.x, tip.y, tip.z]
}

/// Not negative, and far below the limit.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
const fn whole(number: f64) -> u64 {
    number as u64
}

/// What the page shows, for tests: angles and targets in degrees, the tip in mm.
#[wasm_bindgen]
#[must_use]
pub fn state() -> String {
    with_app(|app| {
        let state = app.client.state();
        let registers = app.client.registers();
        let bytes = registers.values.iter().map(u8::to_string).collect::<Vec<_>>().join(",");
        format!(
            r#"{{"connected":{},"measured":{:?},"targets":{:?},"missing":{},"faults":{},"motors":{},"tip":{:?},"time":{},"stop":"{:?}","registers":[{bytes}]}}"#,
            app.client.is_connected(),
            state.angles(),
            state.targets,
            state.missing,
            state.faults,
            state.motor_state,
            tip(state.angles()),
            app.now().as_micros(),
            app.client.stop_progress(),
        )
    })
    .unwrap_or_default()
}

/// Where a point in mm is drawn, in CSS pixels from the top left of the page's window, for tests.
#[wasm_bindgen]
#[must_use]
pub fn project(x: f32, y: f32, z: f32) -> Option<Vec<f64>> {
    with_app(|app| {
        let place = app.scene.as_ref()?.project(Vec3::new(x, y, z))?;
        let canvas = app.dom.element("scene")?.get_bounding_client_rect();
        Some(vec![f64::from(place.x) + canvas.left(), f64::from(place.y) + canvas.top()])
    })?
}

/// The number of frames since the start, for tests.
#[wasm_bindgen]
#[must_use]
pub fn frame_count() -> u32 {
    with_app(|app| app.frames).unwrap_or(0)
}

//! The page as a value: the arm that it has, and what passes between them.

use std::cell::RefCell;
use std::rc::Rc;

use glam::Vec3;
use protocol_core::time::Instant;
use sevenbot::map::VACUUM_PUMP;
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use web_sys::{CanvasRenderingContext2d, Element, Event};

use super::class_tab::ClassTab;
use super::dom::Dom;
use super::exercise_list::Exercises;
use super::kept_recording::KeptRecording;
use super::program_state::Programs;
use super::storage;
use super::time_line_state::TimeLines;
use crate::client::Client;
use crate::movement::Player;
use crate::park::Park;
use crate::plots::{History, Quantity, Sample};
use crate::recorder::Recorder;
use crate::scene::{Part, Scene};
use crate::source::simulator::SimulatedSource;
use crate::source::{LineState, Source};
use crate::stop::StopProgress;
use crate::texts::Language;
use crate::words;

/// Longer pauses of the browser, as in a tab in the background, let no more virtual time pass: 100 ms.
const LONGEST_FRAME_MS: f64 = 100.0;
/// At high speed the client takes part this often, in milliseconds of virtual time: well within the watchdog of a movement that is
/// played.
const STEP_MS: f64 = 20.0;
/// How long the simulation may compute in each frame, in milliseconds, so that 30 pictures a second remain.
const FRAME_BUDGET_MS: f64 = 24.0;
/// A stop of a simulated arm gets this many steps at once: it holds after some, or something is wrong with it.
const STEPS_OF_STOP: u32 = 50;
/// How long plots reach back, in seconds.
const PLOT_SECONDS: f64 = 10.0;

/// Where the arm is.
pub(super) enum Line {
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
pub(super) struct App {
    pub(super) dom: Dom,
    pub(super) line: Line,
    pub(super) client: Client,
    /// A person knows that the connection has ended.
    pub(super) is_end_told: bool,
    /// The controls are switched off, because the server lets nobody write.
    pub(super) are_controls_off: bool,
    /// `None` where the browser has no WebGL2.
    pub(super) scene: Option<Scene>,
    pub(super) plot: CanvasRenderingContext2d,
    pub(super) history: History,
    pub(super) quantity: Quantity,
    pub(super) language: Language,
    /// Of virtual time; 0 is a pause.
    pub(super) speed: f64,
    /// The time of the last frame, in the browser's milliseconds.
    pub(super) last_frame: f64,
    pub(super) shown_round: u64,
    /// Before this round the arm may not have taken what a slider was set to.
    pub(super) slid_round: u64,
    pub(super) frames: u32,
    pub(super) hovered: Option<Part>,
    /// Where the pointer wants the tip although it cannot go there, and the name of the text that says why.
    pub(super) unreachable: Option<(Vec3, &'static str)>,
    /// A joint of a limp arm that the pointer holds.
    pub(super) hand: Option<u8>,
    pub(super) recorder: Option<Recorder>,
    pub(super) park: Option<Park>,
    pub(super) player: Option<Player>,
    pub(super) recording: Option<KeptRecording>,
    pub(super) programs: Programs,
    pub(super) exercises: Exercises,
    pub(super) time_lines: TimeLines,
    pub(super) tour_step: usize,
    /// `None` outside a class.
    pub(super) class: Option<ClassTab>,
    /// The simulated arm, while the page drives the class's real one.
    pub(super) set_aside: Option<(Line, Client)>,
}

thread_local! {
    /// The page is a single one. Handlers of the browser need it after `start` has returned.
    static APP: RefCell<Option<Rc<RefCell<App>>>> = const { RefCell::new(None) };
}

/// Does something with the page, unless it is busy: a handler never runs inside another.
pub(super) fn with_app<T>(act: impl FnOnce(&mut App) -> T) -> Option<T> {
    let app = APP.with_borrow(Clone::clone)?;
    let mut app = app.try_borrow_mut().ok()?;
    Some(act(&mut app))
}

/// Calls `act` for each event of this kind on an element, as long as the page lives.
pub(super) fn on<E: JsCast>(
    target: &Element,
    kind: &str,
    act: impl FnMut(&mut App, &E, &Event) + 'static,
) -> Result<(), JsValue> {
    add_listener(target, kind, act, false)
}

/// As [`on`], before the elements within this one get the event.
pub(super) fn on_first<E: JsCast>(
    target: &Element,
    kind: &str,
    act: impl FnMut(&mut App, &E, &Event) + 'static,
) -> Result<(), JsValue> {
    add_listener(target, kind, act, true)
}

fn add_listener<E: JsCast>(
    target: &Element,
    kind: &str,
    mut act: impl FnMut(&mut App, &E, &Event) + 'static,
    is_first: bool,
) -> Result<(), JsValue> {
    let handler = Closure::<dyn FnMut(Event)>::new(move |event: Event| {
        if let Some(specific) = event.dyn_ref::<E>() {
            with_app(|app| act(app, specific, &event));
        }
    });
    target.add_event_listener_with_callback_and_bool(kind, handler.as_ref().unchecked_ref(), is_first)?;
    handler.forget();
    Ok(())
}

/// The plot is drawn by the processor: a software renderer of the graphics processor takes seconds for it while the page scrolls.
fn plot_context(dom: &Dom) -> Result<CanvasRenderingContext2d, JsValue> {
    let options = js_sys::Object::new();
    js_sys::Reflect::set(&options, &"willReadFrequently".into(), &true.into())?;
    let context = dom.canvas("plot")?.get_context_with_context_options("2d", &options)?;
    Ok(context.ok_or("no 2D canvas")?.unchecked_into())
}

/// The browser's clock, in milliseconds.
pub(super) fn browser_now() -> f64 {
    web_sys::window().and_then(|window| window.performance()).map_or(0.0, |clock| clock.now())
}

impl App {
    /// Makes the page, for [`with_app`].
    pub(super) fn start(dom: Dom) -> Result<(), JsValue> {
        let app = Self::new(dom)?;
        APP.set(Some(Rc::new(RefCell::new(app))));
        Ok(())
    }

    fn new(dom: Dom) -> Result<Self, JsValue> {
        let tag = web_sys::window().and_then(|window| window.navigator().language());
        let tag = storage::load("language").or(tag);
        let language = Language::of_tag(&tag.unwrap_or_default());
        let scene = Scene::new(dom.canvas("scene")?);
        if let Err(reason) = &scene {
            dom.no_picture(language, reason);
        }
        let plot = plot_context(&dom)?;
        Ok(Self {
            dom,
            line: Line::Simulated(Box::default()),
            client: Client::default(),
            is_end_told: false,
            are_controls_off: false,
            scene: scene.ok(),
            plot,
            history: History::new(PLOT_SECONDS),
            quantity: Quantity::Angle,
            language,
            speed: 1.0,
            last_frame: browser_now(),
            shown_round: 0,
            slid_round: 0,
            frames: 0,
            hovered: None,
            unreachable: None,
            hand: None,
            recorder: None,
            park: None,
            player: None,
            recording: KeptRecording::of_storage(),
            programs: Programs::default(),
            exercises: Exercises::default(),
            time_lines: TimeLines::default(),
            tour_step: 0,
            class: None,
            set_aside: None,
        })
    }

    /// The clock of the arm: virtual for a simulated one.
    pub(super) fn now(&self) -> Instant {
        match &self.line {
            Line::Simulated(source) => source.now(),
            Line::Remote(_) => Instant::from_micros(whole(browser_now() * 1e3)),
        }
    }

    /// Before each picture: bytes, time, then the picture.
    pub(super) fn frame(&mut self, time: f64) {
        let elapsed = (time - self.last_frame).clamp(0.0, LONGEST_FRAME_MS);
        self.last_frame = time;
        let until = browser_now() + FRAME_BUDGET_MS;
        // A reply that came since the last picture is not late, however slow the pictures are.
        self.receive();
        let mut rest = if matches!(self.line, Line::Simulated(_)) { elapsed * self.speed } else { 0.0 };
        loop {
            let step = rest.min(STEP_MS);
            self.exchange(step, until);
            rest -= step;
            if rest <= 0.0 || browser_now() >= until {
                break;
            }
        }
        // Asked here, because a call of either would load the rest of the module (`super::rest`) for the first picture.
        if self.time_lines.preview.is_some() {
            self.preview_on(until);
        }
        if self.class.is_some() {
            self.class_on(time);
        }
        self.tell_end_of_line();
        self.show();
        self.frames = self.frames.wrapping_add(1);
    }

    /// Lets a stop of the arm take effect now, whenever the next picture comes: sends it, and lets a simulated arm move on until it
    /// holds, also one whose time stands still.
    pub(super) fn carry_out_stop(&mut self) {
        let until = browser_now() + FRAME_BUDGET_MS;
        for _ in 0..STEPS_OF_STOP {
            self.exchange(STEP_MS, until);
            let is_simulated = matches!(self.line, Line::Simulated(_));
            if !is_simulated || self.client.stop_progress() != StopProgress::Verifying {
                return;
            }
        }
    }

    /// Sends what is due, lets virtual time pass, and takes what the arm has sent.
    fn exchange(&mut self, virtual_ms: f64, until: f64) {
        let now = self.now();
        self.play(now);
        let bytes = self.client.poll(now);
        self.send(&bytes);
        if let Line::Simulated(source) = &mut self.line {
            source.advance(virtual_ms * 1e3, || browser_now() < until);
        }
        self.receive();
    }

    fn receive(&mut self) {
        let bytes = self.line.source().receive();
        let now = self.now();
        self.client.receive(now, &bytes);
        if self.client.rounds() != self.shown_round {
            self.shown_round = self.client.rounds();
            self.new_state(now);
        }
    }

    fn play(&mut self, now: Instant) {
        self.park_on(now);
        self.play_on(now);
        self.run_on(now);
    }

    /// The registers are new.
    #[expect(clippy::cast_precision_loss, reason = "times of years are exact enough")]
    fn new_state(&mut self, now: Instant) {
        let state = self.client.state();
        let vacuum = self.client.registers().byte(&VACUUM_PUMP) != 0;
        if self.exercises.attempt.is_some() {
            self.observe_exercise(now);
        }
        let registers = self.client.registers();
        if let Some(recorder) = &mut self.recorder
            && let Err(fault) = recorder.add(now, registers, vacuum)
        {
            self.end_recording();
            self.dom.notice(&words::recording_failure(self.language, &fault));
        }
        let time = now.as_micros() as f64 / 1e6;
        let (angles, loads, velocities) = (state.angles(), state.loads, state.velocities);
        self.history.push(Sample { time, angles, loads, velocities });
    }

    /// Changes to another arm: everything that belonged to the last one ends.
    pub(super) fn set_line(&mut self, line: Line) {
        drop(self.swap_line((line, Client::default())));
    }

    /// As [`Self::set_line`], with what is known of the arm. Returns the last one.
    pub(super) fn swap_line(&mut self, line: (Line, Client)) -> (Line, Client) {
        if self.recorder.is_some() {
            self.end_recording();
        }
        self.leave_arm();
        let before = (std::mem::replace(&mut self.line, line.0), std::mem::replace(&mut self.client, line.1));
        (self.shown_round, self.slid_round) = (0, 0);
        (self.hand, self.unreachable) = (None, None);
        self.is_end_told = false;
        self.exercises.end();
        self.hide_time_line();
        self.history = History::new(PLOT_SECONDS);
        let is_simulated = matches!(self.line, Line::Simulated(_));
        self.dom.set_hidden("simulator", !is_simulated);
        self.dom.end_notice();
        before
    }

    /// Shows no time line.
    pub(super) fn hide_time_line(&mut self) {
        if self.time_lines.shown.is_some() || self.time_lines.preview.is_some() {
            self.show_time_line(None);
        }
    }

    pub(super) fn send(&mut self, bytes: &[u8]) {
        self.line.source().send(bytes);
    }

    pub(super) fn line_state(&mut self) -> LineState {
        self.line.source().state()
    }
}

/// Converts a number that is not negative and far below the limit.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
pub(super) const fn whole(number: f64) -> u64 {
    number as u64
}

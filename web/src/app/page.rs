//! The state of the page, and the exchange of bytes with its arm.

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
use crate::movement::PagePlayer;
use crate::park::Park;
use crate::plots::{History, PlottedQuantity, Sample};
use crate::recorder::PageRecorder;
use crate::scene::{ArmPart, ArmScene};
use crate::source::simulator::SimulatedSource;
use crate::source::{LineState, Source};
use crate::stop::StopProgress;
use crate::texts::Language;
use crate::words;

/// The most virtual time at speed 1 between two pictures, in milliseconds, also after a longer pause of the browser.
const LONGEST_FRAME_MS: f64 = 100.0;
/// The longest virtual time between two polls of the client, in milliseconds: well within the watchdog of a played movement.
const STEP_MS: f64 = 20.0;
/// The processor time of the simulation for each picture, in milliseconds. It allows 30 pictures per second.
const FRAME_BUDGET_MS: f64 = 24.0;
/// The most steps that a simulated arm gets at once to confirm a stop. A working arm needs fewer.
const STEPS_OF_STOP: u32 = 50;
/// The time span of the plots, in seconds.
const PLOT_SECONDS: f64 = 10.0;

/// The connection to the arm.
pub(super) enum ArmLine {
    Simulated(Box<SimulatedSource>),
    Remote(Box<dyn Source>),
}

impl ArmLine {
    fn source(&mut self) -> &mut dyn Source {
        match self {
            Self::Simulated(source) => source.as_mut(),
            Self::Remote(source) => source.as_mut(),
        }
    }
}

/// The pupil's own arm while the pupil has the class's real arm.
pub(super) struct OwnArm {
    pub(super) line: ArmLine,
    pub(super) client: Client,
    /// What the pupil chose in the list of arms.
    pub(super) chosen: String,
}

/// The state of the page. The browser's handlers reach it by [`with_app`].
pub(super) struct App {
    pub(super) dom: Dom,
    pub(super) line: ArmLine,
    pub(super) client: Client,
    /// The notice that the connection has ended was shown.
    pub(super) is_end_told: bool,
    /// The controls are disabled, because the server is read-only.
    pub(super) are_controls_off: bool,
    /// `None` if the browser has no WebGL2, or if the graphics driver reported an error at the start.
    pub(super) scene: Option<ArmScene>,
    pub(super) plot: CanvasRenderingContext2d,
    pub(super) history: History,
    pub(super) quantity: PlottedQuantity,
    pub(super) language: Language,
    /// Virtual time per real time of a simulated arm; 0 is a pause.
    pub(super) speed: f64,
    /// The time of the last frame, in the browser's milliseconds.
    pub(super) last_frame: f64,
    /// The last round of reads that was handled.
    pub(super) shown_round: u64,
    /// Before this round of reads, the registers may still hold the target from before the last input in a slider or field.
    pub(super) slid_round: u64,
    pub(super) frames: u32,
    pub(super) hovered: Option<ArmPart>,
    /// The position of a dragged tip to which the arm does not go, in mm, and the name of the text that gives the reason.
    pub(super) unreachable: Option<(Vec3, &'static str)>,
    /// The joint of a limp simulated arm that the pointer holds.
    pub(super) hand: Option<u8>,
    pub(super) recorder: Option<PageRecorder>,
    pub(super) park: Option<Park>,
    pub(super) player: Option<PagePlayer>,
    pub(super) recording: Option<KeptRecording>,
    pub(super) programs: Programs,
    pub(super) exercises: Exercises,
    pub(super) time_lines: TimeLines,
    pub(super) tour_step: usize,
    /// `None` outside a class.
    pub(super) class: Option<ClassTab>,
    /// `None` unless this pupil has the class's real arm.
    pub(super) set_aside: Option<OwnArm>,
}

thread_local! {
    /// The only page. Global, because the browser calls its handlers after `start` has returned.
    static APP: RefCell<Option<Rc<RefCell<App>>>> = const { RefCell::new(None) };
}

/// Calls `act` with the page. `None` if there is no page, or if it is borrowed: a handler never runs inside another one.
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

/// As [`on`], but handles the event before the elements inside this one.
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

/// The context of the plot. `willReadFrequently` makes the browser draw it without the graphics processor: where that is emulated
/// in software, drawing takes seconds while the page scrolls.
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
    /// Creates the page, and makes it available to [`with_app`].
    pub(super) fn start(dom: Dom) -> Result<(), JsValue> {
        let app = Self::new(dom)?;
        APP.set(Some(Rc::new(RefCell::new(app))));
        Ok(())
    }

    fn new(dom: Dom) -> Result<Self, JsValue> {
        let tag = web_sys::window().and_then(|window| window.navigator().language());
        let tag = storage::load("language").or(tag);
        let language = Language::of_tag(&tag.unwrap_or_default());
        let scene = ArmScene::new(dom.canvas("scene")?);
        if let Err(reason) = &scene {
            dom.no_picture(language, reason);
        }
        let plot = plot_context(&dom)?;
        Ok(Self {
            dom,
            line: ArmLine::Simulated(Box::default()),
            client: Client::default(),
            is_end_told: false,
            are_controls_off: false,
            scene: scene.ok(),
            plot,
            history: History::new(PLOT_SECONDS),
            quantity: PlottedQuantity::Angle,
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

    /// The time of the arm's clock: virtual for a simulated arm, the browser's clock for others.
    pub(super) fn now(&self) -> Instant {
        match &self.line {
            ArmLine::Simulated(source) => source.now(),
            ArmLine::Remote(_) => Instant::from_micros(whole(browser_now() * 1e3)),
        }
    }

    /// Called before each picture: exchanges bytes, lets virtual time pass, and then draws the picture.
    pub(super) fn frame(&mut self, time: f64) {
        let elapsed = (time - self.last_frame).clamp(0.0, LONGEST_FRAME_MS);
        self.last_frame = time;
        let until = browser_now() + FRAME_BUDGET_MS;
        // Take replies before the client checks timeouts: slow pictures must not make them late.
        self.receive();
        let mut rest = if matches!(self.line, ArmLine::Simulated(_)) { elapsed * self.speed } else { 0.0 };
        loop {
            let step = rest.min(STEP_MS);
            self.exchange(step, until);
            rest -= step;
            if rest <= 0.0 || browser_now() >= until {
                break;
            }
        }
        // Checked here: a call of either function before the first picture would load the rest of the module (`super::rest`).
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

    /// Carries out a stop at once, without waiting for the next picture: sends its frames, and advances a simulated arm, also a
    /// paused one, until it holds. The arm gets at most [`STEPS_OF_STOP`] steps and [`FRAME_BUDGET_MS`].
    pub(super) fn carry_out_stop(&mut self) {
        let until = browser_now() + FRAME_BUDGET_MS;
        for _ in 0..STEPS_OF_STOP {
            self.exchange(STEP_MS, until);
            let is_simulated = matches!(self.line, ArmLine::Simulated(_));
            if !is_simulated || self.client.stop_progress() != StopProgress::Verifying {
                return;
            }
        }
    }

    /// Continues a park, movement or program, sends the frames that are due, and takes the bytes of the arm. A simulated arm
    /// advances by `virtual_ms`, or less if the browser's clock reaches `until`.
    fn exchange(&mut self, virtual_ms: f64, until: f64) {
        let now = self.now();
        self.play(now);
        let bytes = self.client.poll(now);
        self.send(&bytes);
        if let ArmLine::Simulated(source) = &mut self.line {
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

    /// Handles a complete round of reads: passes the new registers to the exercise, the recorder and the plot.
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

    /// Changes to another arm. Ends everything that belongs to the last one.
    pub(super) fn set_line(&mut self, line: ArmLine) {
        drop(self.swap_line((line, Client::default())));
    }

    /// As [`Self::set_line`], but with the client of the arm. Returns the last line and its client.
    pub(super) fn swap_line(&mut self, line: (ArmLine, Client)) -> (ArmLine, Client) {
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
        let is_simulated = matches!(self.line, ArmLine::Simulated(_));
        self.dom.set_hidden("simulator", !is_simulated);
        self.dom.end_notice();
        before
    }

    /// Ends a preview, and hides the time line.
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

/// Rounds a non-negative number down. Numbers out of range saturate.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
pub(super) const fn whole(number: f64) -> u64 {
    number as u64
}

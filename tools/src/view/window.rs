//! The window itself: its events to the session, pictures to the screen, scripts.

use super::board::Board;
use super::overlay;
use super::painter::Painter;
use super::screenshots::Screenshots;
use super::script::{ScriptLine, ScriptStep};
use super::session::{Button, Event, Key, Session, Shot, WindowRequest};
use crate::failure::Failure;
use anyhow::anyhow;
use brickfield_engine::gpu::{PresentOutcome, Presenter};
use brickfield_engine::picture::Canvas;
use std::collections::VecDeque;
use std::panic;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::error::EventLoopError;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{Key as Typed, NamedKey};
use winit::window::{Window as OpenWindow, WindowId};

/// How long a window may take to get the size that a script asks for.
const RESIZE_TIME: Duration = Duration::from_secs(5);
/// How long after a picture that could not be shown it is tried again.
const AGAIN: Duration = Duration::from_millis(50);
/// Pixels that a touchpad scrolls for a notch of a wheel.
const PIXELS_A_NOTCH: f64 = 40.0;
/// What to do without a window.
const WITHOUT: &str = "draw with `brickfield render`, which needs no window";

/// What the painter's thread tells.
#[derive(Clone, Copy, Debug)]
enum PainterMessage {
    /// There is something new on the board.
    Rows,
    /// Nothing new will come.
    Over,
}

/// A window that is to be opened.
pub struct Window {
    pub title: String,
    pub session: Session,
    pub script: Vec<ScriptLine>,
    pub screenshots: Screenshots,
}

impl Window {
    /// Opens the window, and returns when it is closed.
    ///
    /// # Errors
    /// If there is no display, or no Vulkan; what painting and writing screenshots gives.
    pub fn run(self, painter: &mut (dyn Painter + Send)) -> Result<(), Failure> {
        let events = event_loop()?;
        let board = Board::new();
        let proxy = events.create_proxy();
        std::thread::scope(|scope| {
            let over = board.over_at_end();
            let painting = scope.spawn(|| {
                let end = EndNotice(proxy);
                // A window that is gone needs no news.
                board.work(painter, &|| {
                    let _ = end.0.send_event(PainterMessage::Rows);
                })
            });
            let mut app = App::new(self, &board);
            let ran = events.run_app(&mut app);
            let ended = std::mem::replace(&mut app.ended, Ok(()));
            drop(app);
            drop(over);
            painting.join().unwrap_or_else(|cause| panic::resume_unwind(cause))?;
            ran.map_err(|error| anyhow!("the window has failed ({error}); {WITHOUT}"))?;
            ended
        })
    }
}

/// Tells that nothing new will come, whatever the reason.
struct EndNotice(EventLoopProxy<PainterMessage>);

impl Drop for EndNotice {
    fn drop(&mut self) {
        let _ = self.0.send_event(PainterMessage::Over);
    }
}

/// The connection to the display.
fn event_loop() -> Result<EventLoop<PainterMessage>, Failure> {
    // Where a library of the display is not there, winit panics; its message is enough.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let made = panic::catch_unwind(|| EventLoop::with_user_event().build());
    panic::set_hook(hook);
    let why = match made {
        Ok(Ok(events)) => return Ok(events),
        Ok(Err(EventLoopError::Os(error))) => {
            // It begins with a place in winit's source.
            let text = error.to_string();
            text.split_once(".rs:")
                .and_then(|(_, rest)| rest.split_once(": "))
                .map_or(text.clone(), |(_, why)| why.to_owned())
        }
        Ok(Err(error)) => error.to_string(),
        Err(cause) => match (cause.downcast_ref::<String>(), cause.downcast_ref::<&str>()) {
            (Some(text), _) => text.clone(),
            (None, Some(text)) => (*text).to_owned(),
            (None, None) => "a library of the display is missing".to_owned(),
        },
    };
    let why = why.trim_end_matches('.');
    let remedy = if why.to_lowercase().contains("librar") {
        "install libx11-6, libxcursor1, libxi6, libxrandr2 and libxkbcommon-x11-0"
    } else {
        "set DISPLAY to an X server's"
    };
    Err(anyhow!("there is no display for a window ({why}); {remedy}, or {WITHOUT}").into())
}

/// What a script waits for.
enum ScriptWait {
    Picture,
    Screenshots,
    Size([u32; 2], Instant),
    Time(Instant),
}

/// A screenshot that is taken as soon as its picture is complete.
struct Screenshot {
    shot: Shot,
    /// `None` for a free name: the user asked by a key.
    path: Option<PathBuf>,
}

/// The window's state.
struct App<'a> {
    title: String,
    session: Session,
    script: VecDeque<ScriptLine>,
    waiting: Option<ScriptWait>,
    screenshots: Screenshots,
    board: &'a Board,
    // Dropped in this order: pictures are shown in the window.
    presenter: Option<Presenter>,
    window: Option<Arc<OpenWindow>>,
    shift: bool,
    /// The last wish and its number.
    asked: Option<(u64, Shot)>,
    /// The number of the wish whose complete picture was shown.
    shown: u64,
    /// When to show again what could not be shown.
    again: Option<Instant>,
    /// In the order of their taking. Until they are, no other picture is painted: what was seen as they were asked for is what
    /// they show.
    screenshots_due: VecDeque<Screenshot>,
    /// Whether the user wants to quit.
    leaving: bool,
    /// What is said beside the status.
    note: String,
    ended: Result<(), Failure>,
}

impl<'a> App<'a> {
    fn new(window: Window, board: &'a Board) -> App<'a> {
        let Window { title, session, script, screenshots } = window;
        App {
            title,
            session,
            script: script.into(),
            waiting: None,
            screenshots,
            board,
            presenter: None,
            window: None,
            shift: false,
            asked: None,
            shown: 0,
            again: None,
            screenshots_due: VecDeque::new(),
            leaving: false,
            note: String::new(),
            ended: Ok(()),
        }
    }

    /// Opens the window, which is seen only if pictures can be shown in it.
    fn open(&mut self, events: &ActiveEventLoop) -> Result<(), Failure> {
        let [width, height] = self.session.shot().size;
        let wanted = OpenWindow::default_attributes()
            .with_title(&self.title)
            .with_inner_size(PhysicalSize::new(width, height))
            .with_visible(false);
        let window = events.create_window(wanted);
        let window = window.map_err(|error| anyhow!("no window can be opened ({error}); {WITHOUT}"))?;
        let window = Arc::new(window);
        let presenter = Presenter::new(Arc::clone(&window));
        let presenter = presenter.map_err(|why| anyhow!("no pictures can be shown: {why}, or {WITHOUT}"));
        self.presenter = Some(presenter?);
        window.set_visible(true);
        self.resized(window.inner_size(), window.scale_factor());
        self.window = Some(window);
        Ok(())
    }

    fn resized(&mut self, size: PhysicalSize<u32>, density: f64) {
        if size.width > 0 && size.height > 0 {
            self.session.handle(Event::Resize { size: size.into(), density });
        }
    }

    fn handle(&mut self, event: Event) {
        match self.session.handle(event) {
            Some(request) => self.grant(request),
            None => self.redraw(),
        }
    }

    fn grant(&mut self, request: WindowRequest) {
        match request {
            WindowRequest::Quit => {
                // Who asks twice does not want to wait.
                if self.leaving {
                    self.screenshots_due.clear();
                }
                self.leaving = true;
                // Whatever the script is at.
                self.waiting = None;
                self.script = [ScriptLine { number: 0, step: ScriptStep::Quit }].into();
                self.redraw();
            }
            WindowRequest::Screenshot => self.take(None),
        }
    }

    /// Takes a screenshot of what is wanted now, as soon as it is there.
    fn take(&mut self, path: Option<PathBuf>) {
        self.screenshots_due.push_back(Screenshot { shot: self.session.shot(), path });
        self.note = "a screenshot follows".to_owned();
        self.redraw();
    }

    fn redraw(&self) {
        self.window.iter().for_each(|window| window.request_redraw());
    }

    /// What is to be painted: a screenshot that is due, or what the session has come to.
    fn wanted(&self) -> Shot {
        self.screenshots_due.front().map_or_else(|| self.session.shot(), |due| due.shot.clone())
    }

    /// Wishes for it.
    fn ask(&mut self) {
        let shot = self.wanted();
        if self.window.is_some() && self.asked.as_ref().is_none_or(|(_, asked)| *asked != shot) {
            self.asked = Some((self.board.ask(shot.clone()), shot));
        }
    }

    /// Whether all that is wanted is on the board.
    fn is_complete(&self) -> bool {
        let shot = self.wanted();
        self.asked
            .as_ref()
            .is_some_and(|(number, asked)| *asked == shot && self.board.picture().complete == *number)
    }

    /// Shows what there is.
    fn show(&mut self) -> Result<(), Failure> {
        let size = self.session.shot().size;
        let (pixels, complete) = {
            let picture = self.board.picture();
            // Of another size only until the next first picture.
            if picture.size != size {
                return Ok(());
            }
            (picture.pixels.clone(), picture.complete)
        };
        let mut canvas = Canvas::of(size[0] as usize, pixels);
        overlay::draw(&mut canvas, &self.session, &self.note);
        let pixels = canvas.into_pixels();
        let Some(presenter) = &mut self.presenter else { return Ok(()) };
        let outcome = presenter.show(size, &pixels);
        match outcome.map_err(|failure| anyhow!("{}: {failure}; {WITHOUT}", presenter.info().name))? {
            // Without an area there is nothing to be seen.
            PresentOutcome::Shown | PresentOutcome::NoArea => (self.shown, self.again) = (complete, None),
            PresentOutcome::NotYet => self.again = Some(Instant::now() + AGAIN),
        }
        Ok(())
    }

    /// Writes the screenshots whose pictures are complete.
    fn save(&mut self) -> Result<(), Failure> {
        while !self.screenshots_due.is_empty() && self.is_complete() {
            let Some(Screenshot { shot, path }) = self.screenshots_due.pop_front() else { break };
            let is_by_key = path.is_none();
            let path = path.unwrap_or_else(|| self.screenshots.name());
            let written = self.screenshots.write(&path, &self.session, &shot, &self.board.picture());
            self.note = match written {
                Ok(()) => format!("wrote {}", path.display()),
                // Who asked by a key and looks on can ask again.
                Err(Failure::Run(error)) if is_by_key && !self.leaving => format!("{error:#}"),
                Err(error) => return Err(error),
            };
            self.redraw();
            self.ask();
        }
        Ok(())
    }

    /// Goes on in whatever waits. Returns when to look again, if not at the next event.
    fn advance(&mut self, events: &ActiveEventLoop) -> Result<Option<Instant>, Failure> {
        loop {
            self.save()?;
            let is_free = self.screenshots_due.is_empty();
            match self.waiting.take() {
                None => {}
                Some(ScriptWait::Picture)
                    if is_free && self.asked.as_ref().is_some_and(|(n, _)| *n == self.shown) => {}
                Some(ScriptWait::Screenshots) if is_free => {}
                Some(ScriptWait::Size(size, _)) if self.session.shot().size == size => {}
                Some(ScriptWait::Size([width, height], until)) if Instant::now() >= until => {
                    let [w, h] = self.session.shot().size;
                    let what = format!("the window stays {w} x {h} pixels large, not {width} x {height}");
                    return Err(anyhow!("{what}; leave the command `size` out, or use --size").into());
                }
                Some(ScriptWait::Time(until)) if Instant::now() >= until => {}
                Some(waiting) => {
                    let until = match waiting {
                        ScriptWait::Size(_, until) | ScriptWait::Time(until) => Some(until),
                        ScriptWait::Picture | ScriptWait::Screenshots => None,
                    };
                    self.waiting = Some(waiting);
                    return Ok(until);
                }
            }
            let Some(ScriptLine { step, .. }) = self.script.pop_front() else { return Ok(None) };
            match step.perform(&mut self.session) {
                Some(WindowRequest::Quit) if is_free => {
                    events.exit();
                    return Ok(None);
                }
                Some(WindowRequest::Quit) => {
                    self.leaving = true;
                    self.script = [ScriptLine { number: 0, step: ScriptStep::Quit }].into();
                    self.waiting = Some(ScriptWait::Screenshots);
                    return Ok(None);
                }
                Some(request) => self.grant(request),
                None => self.redraw(),
            }
            self.waiting = self.wait_for(step);
            self.ask();
        }
    }

    /// What a step is done by.
    fn wait_for(&mut self, step: ScriptStep) -> Option<ScriptWait> {
        match step {
            ScriptStep::Wait => Some(ScriptWait::Picture),
            ScriptStep::Screenshot(path) => {
                self.take(Some(path));
                Some(ScriptWait::Screenshots)
            }
            ScriptStep::Pause(seconds) => {
                Some(ScriptWait::Time(Instant::now() + Duration::from_secs_f64(seconds)))
            }
            ScriptStep::Size(size) => {
                let window = self.window.as_ref()?;
                // Some systems tell at once, others by an event.
                let _ = window.request_inner_size(PhysicalSize::new(size[0], size[1]));
                Some(ScriptWait::Size(size, Instant::now() + RESIZE_TIME))
            }
            _ => None,
        }
    }

    /// Ends the window with an error.
    fn end(&mut self, events: &ActiveEventLoop, error: Failure) {
        self.ended = Err(error);
        events.exit();
    }
}

impl ApplicationHandler<PainterMessage> for App<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.window.is_none()
            && let Err(error) = self.open(events)
        {
            self.end(events, error);
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, news: PainterMessage) {
        match news {
            PainterMessage::Rows => self.redraw(),
            PainterMessage::Over => events.exit(),
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => self.grant(WindowRequest::Quit),
            WindowEvent::RedrawRequested => {
                if let Err(error) = self.show() {
                    self.end(events, error);
                }
            }
            WindowEvent::Resized(size) => {
                let density = self.session.density();
                self.resized(size, density);
            }
            WindowEvent::ScaleFactorChanged { scale_factor, .. } => {
                let size = self.session.shot().size;
                self.resized(size.into(), scale_factor);
            }
            WindowEvent::ModifiersChanged(modifiers) => self.shift = modifiers.state().shift_key(),
            event => {
                if let Some(event) = event_of(&event, self.shift) {
                    self.handle(event);
                }
            }
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        if events.exiting() {
            return;
        }
        if self.again.is_some_and(|at| Instant::now() >= at) {
            self.again = None;
            self.redraw();
        }
        self.ask();
        match self.advance(events) {
            Ok(until) => {
                let next = until.into_iter().chain(self.again).min();
                events.set_control_flow(next.map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
            }
            Err(error) => self.end(events, error),
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // While the display is still there.
        self.presenter = None;
        self.window = None;
    }
}

/// What an event of the window means to the session, if anything.
fn event_of(event: &WindowEvent, shift: bool) -> Option<Event> {
    match event {
        WindowEvent::CursorMoved { position, .. } => Some(Event::Point([position.x, position.y])),
        WindowEvent::MouseInput { state: ElementState::Released, .. } => Some(Event::Release),
        WindowEvent::MouseInput { button, .. } => {
            let button = match button {
                MouseButton::Left => Button::Left,
                MouseButton::Right => Button::Right,
                MouseButton::Middle => Button::Middle,
                _ => return None,
            };
            Some(Event::Press { button, shift })
        }
        WindowEvent::MouseWheel { delta, .. } => Some(Event::Wheel(match delta {
            MouseScrollDelta::LineDelta(_, notches) => f64::from(*notches),
            MouseScrollDelta::PixelDelta(by) => by.y / PIXELS_A_NOTCH,
        })),
        WindowEvent::KeyboardInput { event, .. } if event.state == ElementState::Pressed => {
            Some(Event::Key(key_of(event)?))
        }
        _ => None,
    }
}

fn key_of(event: &KeyEvent) -> Option<Key> {
    Some(match &event.logical_key {
        Typed::Character(text) => Key::Letter(text.chars().next()?.to_ascii_lowercase()),
        Typed::Named(NamedKey::ArrowUp) => Key::Up,
        Typed::Named(NamedKey::ArrowDown) => Key::Down,
        Typed::Named(NamedKey::PageUp) => Key::PageUp,
        Typed::Named(NamedKey::PageDown) => Key::PageDown,
        Typed::Named(NamedKey::Home) => Key::Home,
        Typed::Named(NamedKey::End) => Key::End,
        Typed::Named(NamedKey::Escape) => Key::Escape,
        _ => return None,
    })
}

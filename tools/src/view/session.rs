//! What the user looks at: events in, what is to be drawn out. Knows no window, so that it is tested without one.

use crate::kinds::typed;
use crate::void_table::VoidPlace;
use brickfield_engine::lattice::Axis;
use brickfield_engine::picture::Canvas;
use brickfield_engine::render::{CutPlane, Focus, View};

/// Degrees that the part turns for each pixel of a drag.
const DEGREES_A_PIXEL: f64 = 0.4;
/// How much larger the part gets by a notch of the wheel.
const ZOOM_A_NOTCH: f64 = 1.2;
/// Layers by which a large step moves the plane.
const LARGE_STEP: f64 = 10.0;
/// Degrees of opening when the picture is in perspective, as `render --perspective` has them.
const OPENING: f64 = 30.0;
/// How far one can go in and out: heights of the picture, in diagonals of the part.
const HEIGHTS: [f64; 2] = [1e-6, 1e2];
/// How much of the world is seen around a void, in its lengths.
const AROUND_VOID: f64 = 6.0;
/// Width of the slider, in pixels of a screen of ordinary density.
const SLIDER_WIDTH: f64 = 28.0;

/// What the session needs to know of a store.
#[derive(Clone, Debug)]
pub struct ViewedStore {
    /// Least and greatest world coordinates.
    pub bounds: [[f64; 3]; 2],
    /// The unit's symbol, for messages.
    pub unit: String,
    /// Distance of the heights at which the cutting plane rests.
    pub pitch: f64,
    /// Names of the styles.
    pub styles: Vec<String>,
    /// Voids that can be looked at one by one, the largest first.
    pub voids: Vec<VoidPlace>,
    /// What the colours of a style mean, with its number.
    pub legend: Option<(usize, Canvas)>,
}

impl ViewedStore {
    /// Where the part begins and ends along an axis.
    pub fn ends(&self, axis: Axis) -> [f64; 2] {
        self.bounds.map(|corner| corner[axis.index()])
    }

    fn length(&self, axis: Axis) -> f64 {
        let [low, high] = self.ends(axis);
        high - low
    }

    /// How many layers there are along an axis; the last may be thinner.
    pub fn layers(&self, axis: Axis) -> f64 {
        // Rounding makes no layer.
        (self.length(axis) / self.pitch - 1e-6).ceil().max(1.0)
    }

    /// The upper end of a layer, from 1 on; 0 for the lower end of the first.
    pub fn top_of(&self, axis: Axis, layer: f64) -> f64 {
        let [low, high] = self.ends(axis);
        (low + layer * self.pitch).clamp(low, high)
    }

    /// The layer that ends at or above a coordinate.
    pub fn layer_at(&self, axis: Axis, at: f64) -> f64 {
        let [low, _] = self.ends(axis);
        ((at - low) / self.pitch - 1e-6).ceil().clamp(0.0, self.layers(axis))
    }
}

/// What is to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    pub view: View,
    pub focus: Focus,
    pub cut: Option<CutPlane>,
    /// By the number of [`ViewedStore::styles`].
    pub style: usize,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

/// Buttons of a mouse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    Left,
    Right,
    Middle,
}

/// Keys that mean something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    Letter(char),
    Up,
    Down,
    PageUp,
    PageDown,
    Home,
    End,
    Escape,
}

/// What comes from the window. Places are in pixels from its upper left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A button goes down where the pointer is.
    Press { button: Button, shift: bool },
    /// All buttons are up.
    Release,
    /// The pointer is here.
    Point([f64; 2]),
    /// Notches of the wheel, away from the user.
    Wheel(f64),
    /// A key goes down.
    Key(Key),
    /// The window has so many pixels, and so many of them count as one of a screen of ordinary density.
    Resize { size: [u32; 2], density: f64 },
}

/// What only the window can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WindowRequest {
    Screenshot,
    Quit,
}

/// What a drag moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Drag {
    Eye,
    Part,
    Plane,
}

/// The state of the window.
pub struct Session {
    part: ViewedStore,
    size: [u32; 2],
    density: f64,
    view: View,
    focus: Focus,
    /// Whether the part is seen as a whole, and is to be when the window's size changes.
    fitted: bool,
    cut: Option<CutPlane>,
    /// Where the plane was across each axis.
    rested: [f64; 3],
    style: usize,
    /// The void that was looked at last, by its place in [`Part::voids`].
    void: Option<usize>,
    help: bool,
    pointer: [f64; 2],
    drag: Option<Drag>,
}

impl Session {
    /// The whole part from `view`.
    pub fn new(part: ViewedStore, view: View, style: usize, size: [u32; 2]) -> Session {
        let rested = Axis::ALL.map(|axis| part.top_of(axis, (part.layers(axis) / 2.0).ceil()));
        let focus = Focus { centre: [0.0; 3], height: 1.0 };
        let (fitted, help, density) = (true, false, 1.0);
        let (pointer, drag, cut, void) = ([0.0; 2], None, None, None);
        let mut session = Session {
            part,
            size,
            density,
            view,
            focus,
            fitted,
            cut,
            rested,
            style,
            void,
            help,
            pointer,
            drag,
        };
        session.fit();
        session
    }

    /// What is to be drawn.
    pub fn shot(&self) -> Shot {
        let Session { view, focus, cut, style, size, .. } = *self;
        Shot { view, focus, cut, style, size }
    }

    /// The part.
    pub fn part(&self) -> &ViewedStore {
        &self.part
    }

    /// What the colours mean that are seen.
    pub fn legend(&self) -> Option<&Canvas> {
        let (style, legend) = self.part.legend.as_ref()?;
        (*style == self.style).then_some(legend)
    }

    /// Whether the list of keys is seen.
    pub fn shows_help(&self) -> bool {
        self.help
    }

    /// Pixels of the window that count as one of a screen of ordinary density.
    pub fn density(&self) -> f64 {
        self.density
    }

    /// The axis of the slider: that of the plane, or z.
    pub fn slider_axis(&self) -> Axis {
        self.cut.map_or(Axis::Z, |cut| cut.axis)
    }

    /// Pixels from the left at which the slider begins; it takes the rest of the window, at most a quarter.
    pub fn slider_left(&self) -> u32 {
        let width = (SLIDER_WIDTH * self.density).round() as u32;
        self.size[0] - width.min(self.size[0] / 4)
    }

    /// One line on what is seen.
    pub fn status(&self) -> String {
        let View { azimuth, elevation, .. } = self.view;
        let style = &self.part.styles[self.style];
        let mut text = format!("{style}   view {azimuth:.0},{elevation:.0}");
        if let Some(void) = self.void {
            text += &format!("   void {} of {}", self.part.voids[void].id, self.part.voids.len());
        }
        if let Some(CutPlane { axis, at, above }) = self.cut {
            let (letter, unit) = (letter(axis), &self.part.unit);
            let (layer, layers) = (self.part.layer_at(axis, at), self.part.layers(axis));
            let sign = if above { '<' } else { '>' };
            text += &format!("   {letter} {sign} {at:.3} {unit}, layer {layer} of {layers}");
        }
        text
    }

    /// The options by which `render` draws a shot, but for a style of a file.
    pub fn options(&self, shot: &Shot) -> String {
        let View { azimuth, elevation, opening } = shot.view;
        let Focus { centre: [x, y, z], height } = shot.focus;
        let ([width, height_px], style) = (shot.size, typed(self.part.styles[shot.style].as_ref()));
        let mut text = format!(
            "--view={azimuth},{elevation} --focus={x},{y},{z},{height} --size {width}x{height_px} --style {style}"
        );
        if opening > 0.0 {
            text += &format!(" --perspective {opening}");
        }
        if let Some(CutPlane { axis, at, above }) = shot.cut {
            text += &format!(" --cut '{}{}{at}'", letter(axis), if above { '>' } else { '<' });
        }
        text
    }

    /// Takes note of what the user did.
    pub fn handle(&mut self, event: Event) -> Option<WindowRequest> {
        match event {
            Event::Press { button, shift } => self.press(button, shift),
            Event::Release => self.drag = None,
            Event::Point(to) => self.point(to),
            Event::Wheel(notches) => self.zoom_at(ZOOM_A_NOTCH.powf(notches), self.pointer),
            Event::Resize { size, density } => {
                (self.size, self.density) = (size.map(|side| side.max(1)), density.max(0.5));
                if self.fitted {
                    self.fit();
                }
            }
            Event::Key(key) => return self.key(key),
        }
        None
    }

    fn press(&mut self, button: Button, shift: bool) {
        let is_on_slider = self.pointer[0] >= f64::from(self.slider_left());
        self.drag = Some(match button {
            Button::Left if is_on_slider => Drag::Plane,
            Button::Left if !shift => Drag::Eye,
            _ => Drag::Part,
        });
        if self.drag == Some(Drag::Plane) {
            self.slide();
        }
    }

    fn point(&mut self, to: [f64; 2]) {
        let [dx, dy] = [to[0] - self.pointer[0], to[1] - self.pointer[1]];
        self.pointer = to;
        match self.drag {
            // The part follows the pointer, so the eye goes the other way.
            Some(Drag::Eye) => self.orbit([-dx * DEGREES_A_PIXEL, dy * DEGREES_A_PIXEL]),
            Some(Drag::Part) => self.pan([dx, -dy]),
            Some(Drag::Plane) => self.slide(),
            None => {}
        }
    }

    fn key(&mut self, key: Key) -> Option<WindowRequest> {
        match key {
            Key::Escape | Key::Letter('q') => return Some(WindowRequest::Quit),
            Key::Letter('s') => return Some(WindowRequest::Screenshot),
            Key::Letter('h' | '?') => self.help = !self.help,
            Key::Letter('f') => self.fit(),
            Key::Letter('p') => self.set_opening(if self.view.opening > 0.0 { 0.0 } else { OPENING }),
            Key::Letter('t') => self.style = (self.style + 1) % self.part.styles.len(),
            Key::Letter('c') => self.cut = None,
            Key::Letter('n') => self.go_on(1),
            Key::Letter('b') => self.go_on(-1),
            Key::Letter('x') => self.cut_across(Axis::X),
            Key::Letter('y') => self.cut_across(Axis::Y),
            Key::Letter('z') => self.cut_across(Axis::Z),
            Key::Letter(digit) => {
                let number = digit.to_digit(10).and_then(|digit| (digit as usize).checked_sub(1));
                if let Some((name, _)) = number.and_then(|number| View::NAMED.get(number)) {
                    self.look(View::named(name).unwrap_or(self.view));
                }
            }
            Key::Up => self.step(1.0),
            Key::Down => self.step(-1.0),
            Key::PageUp => self.step(LARGE_STEP),
            Key::PageDown => self.step(-LARGE_STEP),
            Key::Home => self.step(-f64::MAX),
            Key::End => self.step(f64::MAX),
        }
        None
    }

    /// Turns the eye around what the middle shows, by degrees from the x axis towards y, and upward.
    pub fn orbit(&mut self, [across, up]: [f64; 2]) {
        self.view.azimuth = (self.view.azimuth + across + 180.0).rem_euclid(360.0) - 180.0;
        self.view.elevation = (self.view.elevation + up).clamp(-90.0, 90.0);
    }

    /// Moves the part by pixels to the right and upward.
    pub fn pan(&mut self, by: [f64; 2]) {
        self.fitted = false;
        self.shift(by.map(|pixels| -pixels * self.pixel()));
    }

    /// Moves what the middle shows, by lengths to the right and upward.
    fn shift(&mut self, [x, y]: [f64; 2]) {
        let [right, up, _] = self.view.axes();
        let half = self.diagonal();
        for (a, (right, up)) in right.into_iter().zip(up).enumerate() {
            let [low, high] = self.part.bounds.map(|corner| corner[a]);
            // Nobody gets lost.
            let moved = self.focus.centre[a] + right * x + up * y;
            self.focus.centre[a] = moved.clamp(low - half, high + half);
        }
    }

    /// Makes the part so many times as large, around the middle.
    pub fn zoom(&mut self, factor: f64) {
        self.zoom_at(factor, self.size.map(|side| f64::from(side) / 2.0));
    }

    /// The same around what is seen at a place in the window.
    fn zoom_at(&mut self, factor: f64, at: [f64; 2]) {
        let limits = HEIGHTS.map(|height| height * self.diagonal());
        let height = (self.focus.height / factor).clamp(limits[0], limits[1]);
        if !height.is_finite() {
            return;
        }
        let before = self.pixel();
        self.fitted = false;
        self.focus.height = height;
        let by = before - self.pixel();
        let half = self.size.map(|side| f64::from(side) / 2.0);
        self.shift([(at[0] - half[0]) * by, (half[1] - at[1]) * by]);
    }

    /// Shows the whole part from here.
    pub fn fit(&mut self) {
        self.fitted = true;
        // Angles and opening of a session are sound.
        if let Ok(focus) = self.view.fit(self.part.bounds, self.size) {
            self.focus = focus;
        }
    }

    /// Shows the whole part from there, in perspective as before.
    pub fn look(&mut self, view: View) {
        self.view = View { opening: self.view.opening, ..view };
        self.fit();
    }

    /// Degrees between the upper and the lower border; 0 for parallel rays.
    pub fn set_opening(&mut self, degrees: f64) {
        self.view.opening = degrees;
        if self.fitted {
            self.fit();
        }
    }

    /// Looks at the next void, or at the one before; behind the last comes the first.
    fn go_on(&mut self, by: isize) {
        let count = self.part.voids.len() as isize;
        if count > 0 {
            let from = self.void.map_or(if by > 0 { -1 } else { count }, |void| void as isize);
            self.go_to((from + by).rem_euclid(count) as usize);
        }
    }

    /// Looks at the void with a number of the table, and cuts through its middle; whether there is one.
    pub fn go_to_void(&mut self, id: u64) -> bool {
        let found = self.part.voids.iter().position(|void| void.id == id);
        found.into_iter().for_each(|void| self.go_to(void));
        found.is_some()
    }

    fn go_to(&mut self, number: usize) {
        let VoidPlace { centre, low, high, .. } = self.part.voids[number];
        let longest = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let limits = HEIGHTS.map(|height| height * self.diagonal());
        let height = (AROUND_VOID * longest).clamp(limits[0], limits[1]);
        if !height.is_finite() {
            return;
        }
        (self.void, self.fitted) = (Some(number), false);
        self.focus = Focus { centre, height };
        let axis = self.slider_axis();
        let [least, most] = self.part.ends(axis);
        let at = centre[axis.index()];
        if least < at && at < most {
            self.set_cut(Some(CutPlane { axis, at, above: self.cut.is_none_or(|cut| cut.above) }));
        }
    }

    /// Shows another style.
    pub fn set_style(&mut self, number: usize) {
        self.style = number;
    }

    /// Cuts the part, or closes it.
    pub fn set_cut(&mut self, cut: Option<CutPlane>) {
        self.cut = cut;
        if let Some(cut) = cut {
            self.rested[cut.axis.index()] = cut.at;
        }
    }

    /// Ends the part at the upper end of a layer, from 1 on.
    pub fn set_layer(&mut self, layer: f64) {
        let axis = self.slider_axis();
        let above = self.cut.is_none_or(|cut| cut.above);
        self.rest(axis, layer, above);
    }

    /// Cuts across an axis; across the axis of the cut, takes the other side away.
    fn cut_across(&mut self, axis: Axis) {
        let same = self.cut.filter(|cut| cut.axis == axis);
        let above = same.is_none_or(|cut| !cut.above);
        let at = same.map_or(self.rested[axis.index()], |cut| cut.at);
        // At its very end nothing of the part would be left on the other side.
        let layer = self.part.layer_at(axis, at);
        let is_at_end = layer <= 0.0 || (same.is_some() && layer >= self.part.layers(axis));
        match is_at_end {
            true => self.rest(axis, layer, above),
            false => self.set_cut(Some(CutPlane { axis, at, above })),
        }
    }

    /// Moves the plane by layers, the first time from the upper end.
    fn step(&mut self, layers: f64) {
        let axis = self.slider_axis();
        let CutPlane { at, above, .. } =
            self.cut.unwrap_or(CutPlane { axis, at: self.part.ends(axis)[1], above: true });
        self.rest(axis, self.part.layer_at(axis, at) + layers, above);
    }

    /// Lays the plane upon a layer, of which at least one stays.
    fn rest(&mut self, axis: Axis, layer: f64, above: bool) {
        let layers = self.part.layers(axis);
        let [first, last] = if above { [1.0, layers] } else { [0.0, layers - 1.0] };
        let at = self.part.top_of(axis, layer.round().clamp(first, last));
        self.set_cut(Some(CutPlane { axis, at, above }));
    }

    /// Lays the plane where the pointer is on the slider.
    fn slide(&mut self) {
        let axis = self.slider_axis();
        let up = 1.0 - self.pointer[1] / f64::from(self.size[1]);
        let above = self.cut.is_none_or(|cut| cut.above);
        self.rest(axis, up * self.part.length(axis) / self.part.pitch, above);
    }

    /// Size of a pixel at what the middle shows.
    fn pixel(&self) -> f64 {
        self.focus.height / f64::from(self.size[1])
    }

    fn diagonal(&self) -> f64 {
        Axis::ALL.map(|axis| self.part.length(axis).powi(2)).iter().sum::<f64>().sqrt()
    }
}

/// An axis by its letter.
pub fn letter(axis: Axis) -> char {
    ['x', 'y', 'z'][axis.index()]
}

#[cfg(test)]
mod tests;

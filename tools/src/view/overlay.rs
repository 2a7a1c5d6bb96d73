//! What lies over the picture: the slider, one line on what is seen, what colours mean, and the list of keys.

use super::session::{Session, letter};
use brickfield_engine::picture::{Canvas, GLYPH_HEIGHT, Rgba, text_width};

/// Behind lettering.
const PANEL: Rgba = [250, 250, 250, 255];
/// Letters, and the plane.
const INK: Rgba = [40, 40, 40, 255];
/// The slider where the part is seen, and where it is cut away.
const SEEN: Rgba = [49, 130, 189, 255];
const GONE: Rgba = [205, 210, 215, 255];

/// The keys, as `h` shows them. The lettering knows small letters alone.
const HELP: [&str; 13] = [
    "left drag     turn",
    "right drag    move, also middle or shift",
    "wheel         zoom",
    "1 to 7        iso top bottom front back left right",
    "f             the whole part",
    "p             perspective",
    "t             next style",
    "x y z         cut across, again: other side",
    "up down page  move the cut, or drag the strip",
    "c             no cut",
    "n b           next void, void before",
    "s             screenshot",
    "q esc         quit,  h  this list",
];

/// Draws over a picture of the window's size; `note` follows what the session says of itself.
pub fn draw(canvas: &mut Canvas, session: &Session, note: &str) {
    let dot = (session.density() * 2.0).round().max(1.0) as usize;
    let size = session.shot().size.map(|side| side as usize);
    let note = if note.is_empty() { "h  help" } else { note };
    lines(canvas, &[&format!("{}   {note}", session.status())], size[1], dot);
    if let Some(legend) = session.legend() {
        canvas.lay([0, 0], legend);
    }
    if session.shows_help() {
        let above = size[1].saturating_sub(line_height(dot) * 2);
        lines(canvas, &HELP, above, dot);
    }
    slider(canvas, session, size, dot);
}

/// The strip at the right edge: blue where the part is seen, with the plane's place.
fn slider(canvas: &mut Canvas, session: &Session, [width, height]: [usize; 2], dot: usize) {
    let left = session.slider_left() as usize;
    let axis = session.slider_axis();
    let [low, high] = session.part().ends(axis);
    let cut = session.shot().cut;
    let share = cut.map_or(1.0, |cut| (cut.at - low) / (high - low));
    let plane = ((1.0 - share) * height as f64).round() as usize;
    let [upper, lower] = if cut.is_none_or(|cut| cut.above) { [GONE, SEEN] } else { [SEEN, GONE] };
    canvas.fill([left, 0], [width - left, plane], upper);
    canvas.fill([left, plane], [width - left, height.saturating_sub(plane)], lower);
    canvas.fill([left, 0], [1, height], INK);
    let Some(cut) = cut else { return };
    let thick = 2 * dot;
    let top = plane.saturating_sub(dot).min(height.saturating_sub(thick));
    canvas.fill([left, top], [width - left, thick], INK);
    // Beside the mark, where it fits.
    let text = format!("{} {:.3}", letter(axis), cut.at);
    let wide = text_width(&text, dot) + 4 * dot;
    let tall = line_height(dot);
    let at = [left.saturating_sub(wide), plane.saturating_sub(tall / 2).min(height.saturating_sub(2 * tall))];
    canvas.fill(at, [wide.min(left), tall], PANEL);
    canvas.text([at[0] + 2 * dot, at[1] + 2 * dot], &text, dot, INK);
}

fn line_height(dot: usize) -> usize {
    (GLYPH_HEIGHT + 4) * dot
}

/// Lines of text at the left, the last of them just above `bottom`.
fn lines(canvas: &mut Canvas, texts: &[&str], bottom: usize, dot: usize) {
    let tall = line_height(dot);
    let widest = texts.iter().map(|text| text_width(text, dot)).max().unwrap_or(0) + 4 * dot;
    let top = bottom.saturating_sub(tall * texts.len());
    canvas.fill([0, top], [widest, tall * texts.len()], PANEL);
    for (number, text) in texts.iter().enumerate() {
        canvas.text([2 * dot, top + number * tall + 2 * dot], text, dot, INK);
    }
}

//! Scripts for the window: a command a line.

use super::session::{Button, Event, Key, Session, ViewedStore, WindowRequest, letter};
use crate::finding_args::ShownArg;
use crate::output::in_line;
use crate::picture_args::{AxisArg, CutArg, PixelsArg, ViewArg};
use crate::units::Position;
use anyhow::{Context, anyhow};
use brickfield_engine::lattice::Axis;
use brickfield_engine::render::CutPlane;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// No script is longer.
const BYTES_MAX: u64 = 1 << 20;
/// Longest pause, in seconds.
const PAUSE_MAX: f64 = 3600.0;

/// A command.
#[derive(Clone, Debug)]
pub enum ScriptStep {
    Orbit([f64; 2]),
    Pan([f64; 2]),
    Zoom(f64),
    View(ViewArg),
    Perspective(f64),
    Fit,
    Cut(Option<CutArg>),
    Layer(f64),
    /// By its number in the table of --voids
    Void(u64),
    /// By its name or file
    Style(String),
    Size([u32; 2]),
    Key(Key),
    Drag {
        button: Button,
        from: [f64; 2],
        to: [f64; 2],
    },
    Wheel(f64),
    Wait,
    Pause(f64),
    Screenshot(PathBuf),
    Quit,
}

/// A command and its line, from 1.
#[derive(Clone, Debug)]
pub struct ScriptLine {
    pub number: usize,
    pub step: ScriptStep,
}

/// Reads a script, `-` for standard input.
///
/// # Errors
/// One line on what is wrong: file, line, and what is expected.
pub fn read(path: &Path) -> anyhow::Result<Vec<ScriptLine>> {
    let name = in_line(path);
    let mut text = String::new();
    let read = if path == Path::new("-") {
        std::io::stdin().take(BYTES_MAX + 1).read_to_string(&mut text)
    } else {
        let file = std::fs::File::open(path).with_context(|| format!("{name}: cannot open the script"))?;
        file.take(BYTES_MAX + 1).read_to_string(&mut text)
    };
    read.with_context(|| format!("{name}: cannot read the script"))?;
    if text.len() as u64 > BYTES_MAX {
        return Err(anyhow!("{name}: the file is too long to be a script; give one of a command a line"));
    }
    parse(&text).map_err(|what| anyhow!("{name}: {what}"))
}

/// The commands of a text, or what is wrong with it.
fn parse(text: &str) -> Result<Vec<ScriptLine>, String> {
    let mut lines = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split('#').next().unwrap_or_default().trim();
        if !line.is_empty() {
            let step = line.parse().map_err(|what| format!("line {number}: {what}"))?;
            lines.push(ScriptLine { number, step });
        }
    }
    Ok(lines)
}

/// The cut in a part, or why there is none.
pub fn place(cut: CutArg, part: &ViewedStore) -> Result<CutPlane, String> {
    let (axis, unit) = (Axis::from(cut.axis), &part.unit);
    let at = cut.at.in_unit_of(unit).ok_or("the store has no unit of length; give numbers alone")?;
    let [low, high] = part.ends(axis);
    let leaves = if cut.above { low < at && at <= high } else { low <= at && at < high };
    if leaves {
        return Ok(CutPlane { axis, at, above: cut.above });
    }
    let letter = letter(axis);
    Err(format!("a cut at {letter} = {at} leaves all or nothing; choose one from {low} to {high} {unit}"))
}

impl ScriptStep {
    /// Does what needs no window but a session; what only a window can do is left.
    pub fn perform(&self, session: &mut Session) -> Option<WindowRequest> {
        match *self {
            ScriptStep::Orbit(by) => session.orbit(by),
            ScriptStep::Pan(by) => session.pan(by),
            ScriptStep::Zoom(factor) => session.zoom(factor),
            ScriptStep::View(view) => session.look(view.0),
            ScriptStep::Perspective(degrees) => session.set_opening(degrees),
            ScriptStep::Fit => session.fit(),
            ScriptStep::Cut(None) => session.set_cut(None),
            ScriptStep::Cut(Some(cut)) => {
                let placed = place(cut, session.part());
                session.set_cut(placed.ok());
            }
            ScriptStep::Layer(layer) => session.set_layer(layer),
            ScriptStep::Void(id) => drop(session.go_to_void(id)),
            ScriptStep::Style(ref name) => {
                let number = session.part().styles.iter().position(|style| style == name);
                number.into_iter().for_each(|number| session.set_style(number));
            }
            ScriptStep::Key(key) => return session.handle(Event::Key(key)),
            ScriptStep::Drag { button, from, to } => {
                let press = Event::Press { button, shift: false };
                for event in [Event::Point(from), press, Event::Point(to), Event::Release] {
                    session.handle(event);
                }
            }
            ScriptStep::Wheel(notches) => drop(session.handle(Event::Wheel(notches))),
            ScriptStep::Quit => return Some(WindowRequest::Quit),
            ScriptStep::Size(_) | ScriptStep::Wait | ScriptStep::Pause(_) | ScriptStep::Screenshot(_) => {}
        }
        None
    }
}

impl FromStr for ScriptStep {
    type Err = String;

    fn from_str(line: &str) -> Result<ScriptStep, String> {
        let (command, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match command {
            "orbit" => Ok(ScriptStep::Orbit(numbers(rest, "two angles in degrees, as in orbit 30 10")?)),
            "pan" => Ok(ScriptStep::Pan(numbers(rest, "pixels to the right and upward, as in pan 100 -20")?)),
            "zoom" => {
                let expected = "a factor above 0, as in zoom 2";
                let [factor] = numbers(rest, expected)?;
                if factor > 0.0 { Ok(ScriptStep::Zoom(factor)) } else { Err(format!("expected {expected}")) }
            }
            "view" => Ok(ScriptStep::View(rest.parse()?)),
            "perspective" => {
                let expected = "off, or 1 to 150 degrees, as in perspective 30";
                let [degrees] = if rest == "off" { [0.0] } else { numbers(rest, expected)? };
                let is_sound = rest == "off" || (1.0..=150.0).contains(&degrees);
                if is_sound {
                    Ok(ScriptStep::Perspective(degrees))
                } else {
                    Err(format!("expected {expected}"))
                }
            }
            "fit" => bare(rest, ScriptStep::Fit),
            "cut" if rest == "off" => Ok(ScriptStep::Cut(None)),
            "cut" => Ok(ScriptStep::Cut(Some(cut(rest)?))),
            "layer" => {
                let expected = "a layer from 1 on, as in layer 12";
                let layer = rest.parse::<u32>().ok().filter(|layer| *layer > 0);
                layer
                    .map(|layer| ScriptStep::Layer(layer.into()))
                    .ok_or_else(|| format!("expected {expected}"))
            }
            "void" => {
                let expected = "the number of a void, as in void 3";
                rest.parse().map(ScriptStep::Void).map_err(|_| format!("expected {expected}"))
            }
            "style" => rest.parse::<ShownArg>().map(|_| ScriptStep::Style(rest.to_owned())),
            "size" => rest.parse().map(|PixelsArg(size)| ScriptStep::Size(size)),
            "key" => key(rest).map(ScriptStep::Key).ok_or_else(|| {
                "expected a letter or digit, up, down, pageup, pagedown, home, end or escape".to_owned()
            }),
            "drag" => drag(rest),
            "wheel" => {
                let [notches] = numbers(rest, "notches, as in wheel -2")?;
                Ok(ScriptStep::Wheel(notches))
            }
            "wait" => bare(rest, ScriptStep::Wait),
            "pause" => {
                let expected = "seconds, as in pause 0.5";
                let [seconds] = numbers(rest, expected)?;
                let is_sound = (0.0..=PAUSE_MAX).contains(&seconds);
                if is_sound { Ok(ScriptStep::Pause(seconds)) } else { Err(format!("expected {expected}")) }
            }
            "screenshot" if Path::new(rest).extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) => {
                Ok(ScriptStep::Screenshot(rest.into()))
            }
            "screenshot" => Err("the screenshot's name must end in .png".to_owned()),
            "quit" => bare(rest, ScriptStep::Quit),
            _ => Err(format!("there is no command {command}; `brickfield view --help` lists them")),
        }
    }
}

fn bare(rest: &str, step: ScriptStep) -> Result<ScriptStep, String> {
    if rest.is_empty() { Ok(step) } else { Err(format!("{rest} is too much here")) }
}

/// Numbers of a script: far beyond any screen or angle, and nothing overflows.
const NUMBER_MAX: f64 = 1e9;

/// So many numbers.
fn numbers<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    let number = |word: &str| word.parse::<f64>().ok().filter(|number| number.abs() <= NUMBER_MAX);
    let found: Option<Vec<f64>> = text.split_whitespace().map(number).collect();
    found.and_then(|found| found.try_into().ok()).ok_or_else(|| format!("expected {expected}"))
}

/// `z 12mm` cuts away what lies above, `z<12mm` what lies below, as in `render`.
fn cut(text: &str) -> Result<CutArg, String> {
    if text.contains(['<', '>']) {
        return text.parse();
    }
    let (axis, at) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let axis = match axis {
        "x" => AxisArg::X,
        "y" => AxisArg::Y,
        "z" => AxisArg::Z,
        _ => return Err("expected an axis and a coordinate, as in cut z 12mm, or off".to_owned()),
    };
    let at: Position = at.trim().parse()?;
    Ok(CutArg { axis, above: true, at })
}

fn key(name: &str) -> Option<Key> {
    let mut letters = name.chars();
    if let (Some(letter), None) = (letters.next(), letters.next()) {
        return letter.is_ascii_alphanumeric().then_some(Key::Letter(letter));
    }
    let keys = [
        ("up", Key::Up),
        ("down", Key::Down),
        ("pageup", Key::PageUp),
        ("pagedown", Key::PageDown),
        ("home", Key::Home),
        ("end", Key::End),
        ("escape", Key::Escape),
    ];
    keys.into_iter().find_map(|(known, key)| (known == name).then_some(key))
}

fn drag(rest: &str) -> Result<ScriptStep, String> {
    let expected = "a button and two places in pixels, as in drag left 100 100 180 120";
    let (button, places) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
    let button = match button {
        "left" => Button::Left,
        "right" => Button::Right,
        "middle" => Button::Middle,
        _ => return Err(format!("expected {expected}")),
    };
    let [x0, y0, x1, y1] = numbers(places, expected)?;
    Ok(ScriptStep::Drag { button, from: [x0, y0], to: [x1, y1] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_read_and_comments_left_out() {
        let text = "# a look\norbit 30 -10\n\n  zoom 2 # closer\ncut z 12mm\ncut x<-1\ncut off\nlayer 3\nkey t\n\
                    key pageup\ndrag right 1 2 3 4\nwheel -1\nview 30,20\nview top\nstyle boundary\nsize 640x480\n\
                    perspective\t30\nperspective off\npan 1 2\nfit\nvoid 3\nwait\npause 0.1\nscreenshot a b.png\nquit\n";
        let lines = parse(text).unwrap();
        assert_eq!((lines.len(), lines[0].number, lines[1].number), (23, 2, 4));
        assert!(matches!(lines[0].step, ScriptStep::Orbit([30.0, -10.0])));
        assert!(matches!(&lines[3].step, ScriptStep::Cut(Some(cut)) if cut.axis == AxisArg::X && !cut.above));
        assert!(
            matches!(&lines[2].step, ScriptStep::Cut(Some(cut)) if cut.at.in_unit_of("mm") == Some(12.0))
        );
        assert!(matches!(&lines[21].step, ScriptStep::Screenshot(path) if path == Path::new("a b.png")));
    }

    #[test]
    fn what_is_no_command_is_refused_with_its_line() {
        for bad in [
            "fly",
            "orbit",
            "orbit 1",
            "orbit 1 nan",
            "zoom 0",
            "zoom -1",
            "pan 1 2 3",
            "view inside",
            "cut",
            "cut w 1",
            "cut z",
            "cut z 1parsec",
            "layer 0",
            "layer 1.5",
            "void",
            "void -1",
            "style none",
            "size 0x1",
            "key",
            "key return",
            "drag left 1 2 3",
            "drag 1 2 3 4",
            "wheel",
            "wait 3",
            "pause -1",
            "pause 1e9",
            "perspective 0",
            "perspective 170",
            "screenshot",
            "screenshot a.jpg",
            "quit now",
            "fit x",
        ] {
            let error = parse(&format!("fit\n{bad}\n")).unwrap_err();
            assert!(error.starts_with("line 2: ") && !error.contains('\n'), "{bad}: {error}");
        }
    }
}

//! Styles of pictures as users write them: TOML files.

use crate::failure::Failure;
use crate::output::in_line;
use crate::picture_args::ColourArg;
use crate::units::Length;
use anyhow::{Context, anyhow};
use brickfield_engine::render::{
    BRIGHTNESS_MAX, IsoSurface, Lighting, Paint, Stops, Style, VolumeStyle, W_MAX,
};
use serde::Deserialize;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;

/// No style is longer.
const BYTES_MAX: u64 = 1 << 20;

/// What a file says: a style, and what lies behind.
#[derive(Debug)]
pub struct StyleFile {
    pub style: Style,
    pub background: Option<ColourArg>,
}

/// Reads a style; lengths in it become numbers in `unit`, the store's.
pub fn read(path: &Path, unit: &str) -> Result<StyleFile, Failure> {
    let name = in_line(path);
    let file = std::fs::File::open(path).with_context(|| format!("{name}: cannot open the style"))?;
    let mut text = String::new();
    let read = file.take(BYTES_MAX + 1).read_to_string(&mut text);
    read.with_context(|| format!("{name}: cannot read the style"))?;
    if text.len() as u64 > BYTES_MAX {
        return Err(anyhow!("{name}: the file is too long to be a style; give one of TOML").into());
    }
    parse(&text, unit).map_err(|what| anyhow!("{name}: {what}").into())
}

/// The style that a text describes, or one line on what is wrong with it: line, key, and why.
fn parse(text: &str, unit: &str) -> Result<StyleFile, String> {
    let file: File = toml::from_str(text).map_err(|error| said(text, error))?;
    let surfaces = file.surface.unwrap_or_default().into_iter().map(SurfaceTable::style).collect();
    let volume = file.volume.map(|volume| volume.style(text, unit)).transpose()?;
    let lighting = file.light.map_or_else(Lighting::default, LightTable::style);
    let style = Style { surfaces, volume, lighting };
    style.check().map_err(|error| error.to_string())?;
    Ok(StyleFile { style, background: file.background })
}

/// What the reader of TOML says, in a line: `line 3: opacity: ...`.
fn said(text: &str, mut error: toml::de::Error) -> String {
    let line = error.span().map(|span| line_of(text, span.start));
    // Without the text it does not repeat it, and names the key.
    error.set_input(None);
    let said = error.to_string();
    let (message, key) = said.trim_end().rsplit_once("\nin `").unwrap_or((said.trim_end(), ""));
    let key = key.trim_end_matches('`');
    let place = [line.unwrap_or_default(), key.to_owned()].into_iter().filter(|part| !part.is_empty());
    place.chain([message.replace('\n', ", ")]).collect::<Vec<_>>().join(": ")
}

fn line_of(text: &str, at: usize) -> String {
    format!("line {}", text.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    background: Option<ColourArg>,
    surface: Option<Vec<SurfaceTable>>,
    volume: Option<VolumeTable>,
    light: Option<LightTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceTable {
    w: Winding,
    colour: PaintArg,
    opacity: Option<Share>,
    rim: Option<Share>,
    shaded: Option<bool>,
}

impl SurfaceTable {
    fn style(self) -> IsoSurface {
        let [opacity, rim] = [self.opacity.unwrap_or(Share(1.0)), self.rim.unwrap_or(Share(0.0))];
        IsoSurface {
            w: self.w.0,
            paint: self.colour.0,
            opacity: opacity.0,
            rim: rim.0,
            shaded: self.shaded.unwrap_or(true),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VolumeTable {
    opacity: OpacityStops,
    colour: ColourStops,
    stretch: Option<toml::Spanned<LengthArg>>,
    shaded: Option<bool>,
}

impl VolumeTable {
    fn style(self, text: &str, unit: &str) -> Result<VolumeStyle, String> {
        let in_unit = |length: toml::Spanned<LengthArg>| {
            let at = length.span().start;
            length.into_inner().0.in_unit_of(unit).ok_or_else(|| {
                let line = line_of(text, at);
                format!("{line}: volume.stretch: the store has no unit of length; give a number alone")
            })
        };
        Ok(VolumeStyle {
            opacity: self.opacity.0,
            colour: self.colour.0,
            shaded: self.shaded.unwrap_or(true),
            stretch: self.stretch.map(in_unit).transpose()?,
        })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightTable {
    from: Option<Direction>,
    ambient: Option<Brightness>,
    strength: Option<Brightness>,
    fill: Option<Brightness>,
    gloss: Option<Share>,
}

impl LightTable {
    fn style(self) -> Lighting {
        let usual = Lighting::default();
        Lighting {
            from: self.from.map_or(usual.from, |from| from.0),
            ambient: self.ambient.map_or(usual.ambient, |light| light.0),
            strength: self.strength.map_or(usual.strength, |light| light.0),
            fill: self.fill.map_or(usual.fill, |light| light.0),
            gloss: self.gloss.map_or(usual.gloss, |gloss| gloss.0),
        }
    }
}

// Values that are checked as they are read, so that errors know their line and key.

/// The value, if it is in the range.
fn within(value: f64, range: RangeInclusive<f64>, what: &str) -> Result<f64, String> {
    let (from, to) = (range.start(), range.end());
    range.contains(&value).then_some(value).ok_or_else(|| format!("expected a {what} from {from} to {to}"))
}

#[derive(Deserialize)]
#[serde(try_from = "f64")]
struct Winding(f64);

impl TryFrom<f64> for Winding {
    type Error = String;

    fn try_from(w: f64) -> Result<Winding, String> {
        let expected = || format!("expected a winding number above 0, up to {W_MAX}");
        (w > 0.0 && w <= W_MAX).then_some(Winding(w)).ok_or_else(expected)
    }
}

#[derive(Deserialize)]
#[serde(try_from = "f64")]
struct Share(f64);

impl TryFrom<f64> for Share {
    type Error = String;

    fn try_from(share: f64) -> Result<Share, String> {
        within(share, 0.0..=1.0, "number").map(Share)
    }
}

#[derive(Deserialize)]
#[serde(try_from = "f64")]
struct Brightness(f64);

impl TryFrom<f64> for Brightness {
    type Error = String;

    fn try_from(light: f64) -> Result<Brightness, String> {
        within(light, 0.0..=BRIGHTNESS_MAX, "number").map(Brightness)
    }
}

#[derive(Deserialize)]
#[serde(try_from = "[f64; 3]")]
struct Direction([f64; 3]);

impl TryFrom<[f64; 3]> for Direction {
    type Error = String;

    fn try_from(from: [f64; 3]) -> Result<Direction, String> {
        let is_sound = from.iter().all(|c| c.abs() <= 1e6) && from != [0.0; 3];
        let expected = || "expected three numbers: to the right, upward, towards the eye".to_owned();
        is_sound.then_some(Direction(from)).ok_or_else(expected)
    }
}

#[derive(Deserialize)]
#[serde(try_from = "String")]
struct PaintArg(Paint);

impl TryFrom<String> for PaintArg {
    type Error = String;

    fn try_from(text: String) -> Result<PaintArg, String> {
        if text == "counted" {
            return Ok(PaintArg(Paint::Counted));
        }
        let wrong = || "expected counted, or a colour as #20304a".to_owned();
        Ok(PaintArg(Paint::Plain(plain(&text).ok_or_else(wrong)?)))
    }
}

/// An opaque colour.
fn plain(text: &str) -> Option<[u8; 3]> {
    match text.parse() {
        Ok(ColourArg([r, g, b, 255])) => Some([r, g, b]),
        _ => None,
    }
}

#[derive(Deserialize)]
#[serde(try_from = "Vec<(f64, f64)>")]
struct OpacityStops(Stops<1>);

impl TryFrom<Vec<(f64, f64)>> for OpacityStops {
    type Error = String;

    fn try_from(stops: Vec<(f64, f64)>) -> Result<OpacityStops, String> {
        if let Some((_, opacity)) = stops.iter().find(|(_, opacity)| !(0.0..=1.0).contains(opacity)) {
            return Err(format!("expected pairs of w and an opacity from 0 to 1, not {opacity}"));
        }
        if stops.len() < 2 {
            return Err("expected two stops or more: what lies between is seen".to_owned());
        }
        let stops = Stops::new(stops.into_iter().map(|(w, opacity)| (w, [opacity])).collect());
        Ok(OpacityStops(stops.map_err(|error| error.to_string())?))
    }
}

#[derive(Deserialize)]
#[serde(try_from = "Vec<(f64, String)>")]
struct ColourStops(Stops<3>);

impl TryFrom<Vec<(f64, String)>> for ColourStops {
    type Error = String;

    fn try_from(stops: Vec<(f64, String)>) -> Result<ColourStops, String> {
        let stop = |(w, text): (f64, String)| {
            let wrong = || format!("expected pairs of w and a colour as #20304a, not {text}");
            Ok((w, plain(&text).ok_or_else(wrong)?.map(f64::from)))
        };
        let stops: Vec<_> = stops.into_iter().map(stop).collect::<Result<_, String>>()?;
        Ok(ColourStops(Stops::new(stops).map_err(|error| error.to_string())?))
    }
}

#[derive(Deserialize)]
#[serde(try_from = "String")]
struct LengthArg(Length);

impl TryFrom<String> for LengthArg {
    type Error = String;

    fn try_from(text: String) -> Result<LengthArg, String> {
        text.parse().map(LengthArg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The styles that are built in, as files to begin with.
    const FILES: [(&str, &str); 3] = [
        ("solid", include_str!("../styles/solid.toml")),
        ("boundary", include_str!("../styles/boundary.toml")),
        ("overlap", include_str!("../styles/overlap.toml")),
    ];

    #[test]
    fn the_files_say_what_is_built_in() {
        for ((name, style), (file, text)) in Style::NAMED.into_iter().zip(FILES) {
            assert_eq!(name, file);
            let read = parse(text, "mm").unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(read.style, style(), "{name}");
            assert_eq!(read.background, Some(ColourArg([255; 4])), "{name}");
        }
    }

    #[test]
    fn all_of_a_file_is_read() {
        let text = "background = \"transparent\"\n[light]\nfrom = [1, 0, 2]\nambient = 0.5\ngloss = 0\n\
            [[surface]]\nw = 1.5\ncolour = \"#010203\"\nopacity = 0.25\nshaded = false\n\
            [volume]\nopacity = [[0.5, 0], [1.5, 0.75]]\ncolour = [[1, \"#ff0000\"]]\nstretch = \"0.5cm\"\n";
        let StyleFile { style, background } = parse(text, "mm").unwrap();
        assert_eq!(background, Some(ColourArg([0; 4])));
        let light = Lighting { from: [1.0, 0.0, 2.0], ambient: 0.5, gloss: 0.0, ..Lighting::default() };
        assert_eq!(style.lighting, light);
        let paint = Paint::Plain([1, 2, 3]);
        let surface = IsoSurface { w: 1.5, paint, opacity: 0.25, rim: 0.0, shaded: false };
        assert_eq!(style.surfaces, [surface]);
        let volume = style.volume.unwrap();
        assert_eq!((volume.stretch, volume.shaded), (Some(5.0), true));
        assert_eq!((volume.opacity.at(1.0), volume.colour.at(9.0)), ([0.375], [255.0, 0.0, 0.0]));
    }

    #[test]
    fn errors_name_line_and_key() {
        let surface = "[[surface]]\nw = 0.5\ncolour = \"counted\"\n";
        let volume =
            |opacity: &str, colour: &str| format!("[volume]\nopacity = {opacity}\ncolour = {colour}\n");
        let pairs = "[[0, 0.1], [1, 0.2]]";
        let red = "[[0, \"#ff0000\"]]";
        for (text, line, part) in [
            (format!("{surface}opacity = 1.5\n"), "line 4: surface.opacity: ", "from 0 to 1"),
            (format!("{surface}opacity = \"all\"\n"), "line 4: surface.opacity: ", "invalid type"),
            (format!("{surface}glow = 1\n"), "line 4: surface: ", "unknown field `glow`"),
            ("[[surface]]\nw = 0.5\ncolour = \"plaid\"".to_owned(), "line 3: surface.colour: ", "#20304a"),
            ("\n[[surface]]\nw = nan\ncolour = \"counted\"".to_owned(), "line 3: surface.w: ", "winding"),
            ("[[surface]]\nw = -0.5\ncolour = \"counted\"".to_owned(), "line 2: surface.w: ", "above 0"),
            ("[[surface]]\nw = 0\ncolour = \"counted\"".to_owned(), "line 2: surface.w: ", "up to 32767"),
            ("[[surface]]\nw = 0.5\n".to_owned(), "line 1: surface: ", "missing field `colour`"),
            ("background = 7".to_owned(), "line 1: background: ", "invalid type"),
            ("background = \"plaid\"".to_owned(), "line 1: background: ", "white, black"),
            ("a = 1\nb = [".to_owned(), "line 2: ", "unclosed"),
            ("[light]\nfrom = [0, 0, 0]".to_owned(), "line 2: light.from: ", "three numbers"),
            ("[light]\nambient = -1".to_owned(), "line 2: light.ambient: ", "from 0 to 4"),
            (volume("[[1, 0.1], [0, 0.2]]", red), "line 2: volume.opacity: ", "follows"),
            (volume("[[1, 0.1]]", red), "line 2: volume.opacity: ", "two stops"),
            (volume("[[0, 0.1], [1, 2]]", red), "line 2: volume.opacity: ", "from 0 to 1"),
            (volume(pairs, "[[0, \"#ff00\"]]"), "line 3: volume.colour: ", "#20304a"),
            (volume(pairs, "[]"), "line 3: volume.colour: ", "stops"),
            (volume(pairs, red) + "stretch = \"5 parsec\"", "line 4: volume.stretch: ", ""),
            (surface.repeat(5), "", "1 to 4 surfaces"),
            (String::new(), "", "nothing to show"),
        ] {
            let error = parse(&text, "mm").expect_err(&text);
            assert!(error.starts_with(line) && error.contains(part), "{text}\n{error}");
            assert!(!error.contains('\n'), "{error}");
        }
        let lengthy = volume(pairs, red) + "stretch = \"5mm\"";
        assert!(
            parse(&lengthy, "").unwrap_err().starts_with("line 4: volume.stretch: the store has no unit")
        );
    }
}

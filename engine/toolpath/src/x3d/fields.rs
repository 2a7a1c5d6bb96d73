//! The fields of nodes as they stand in attributes: numbers by the million, flags, names.
//!
//! A spine may be hundreds of megabytes of text in one attribute, so its numbers are cut straight out of the
//! file's bytes. Numbers are separated by white space and commas in any mixture, as players have it.

use super::affine::Transform;
use super::extrusion::Extrusion;
use quick_xml::escape::unescape;
use quick_xml::events::attributes::Attributes;
use std::borrow::Cow;

/// Largest magnitude of an SFFloat: keeps every product of a few coordinates finite.
const FLOAT_MAX: f64 = f32::MAX as f64;

/// Characters of a text from the file that a message shows.
const SHOWN: usize = 24;

impl Extrusion {
    /// Replaces the fields by those of a node, and returns its USE name if it has one.
    ///
    /// # Errors
    /// What is wrong with them, without the place. The DEF name stands in `def` nevertheless.
    pub(super) fn fill(&mut self, attributes: Attributes<'_>) -> Result<Option<String>, String> {
        self.reset();
        let mut used = None;
        let mut wrong = None;
        for (name, value) in fields(attributes) {
            let done = text(value).and_then(|value| {
                match name {
                    "DEF" => self.def = Some(value.into_owned()),
                    "USE" => used = Some(value.into_owned()),
                    _ => self.set(name, &value)?,
                }
                Ok(())
            });
            wrong = wrong.or(done.err().map(|what| format!("{name} {what}")));
        }
        match wrong {
            Some(what) => Err(what),
            None => self.check().map(|()| used),
        }
    }

    /// Sets one field; names of no interest are passed over.
    fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        match name {
            "crossSection" => numbers(value, &mut self.cross_section)?,
            "spine" => numbers(value, &mut self.spine)?,
            "scale" => numbers(value, &mut self.scale)?,
            "orientation" => numbers(value, &mut self.orientation)?,
            "beginCap" => self.begin_cap = flag(value)?,
            "endCap" => self.end_cap = flag(value)?,
            "ccw" => self.ccw = flag(value)?,
            "convex" => self.convex = flag(value)?,
            "solid" => self.solid = flag(value)?,
            _ => {}
        }
        Ok(())
    }

    /// The counts and signs that 13.3.5 asks for.
    fn check(&self) -> Result<(), String> {
        let points = self.spine.len();
        for (name, count) in [("scale", self.scale.len()), ("orientation", self.orientation.len())] {
            if count != 1 && count < points {
                return Err(format!(
                    "{name} has {count} values for {points} spine points, which is undefined"
                ));
            }
        }
        match self.scale.iter().take(points).flatten().find(|s| **s <= 0.0) {
            Some(scale) => Err(format!("scale holds {scale}, but must be above zero")),
            None => Ok(()),
        }
    }
}

/// The fields of a Transform node.
///
/// # Errors
/// What is wrong with them, without the place.
pub(super) fn transform(attributes: Attributes<'_>) -> Result<Transform, String> {
    let mut transform = Transform::default();
    for (name, value) in fields(attributes) {
        let done = match name {
            "translation" => vector(value).map(|v| transform.translation = v),
            "center" => vector(value).map(|v| transform.center = v),
            "rotation" => vector(value).map(|v| transform.rotation = v),
            "scale" => vector(value).map(|v| transform.scale = v),
            "scaleOrientation" => vector(value).map(|v| transform.scale_orientation = v),
            _ => Ok(()),
        };
        done.map_err(|what| format!("{name} {what}"))?;
    }
    Ok(transform)
}

/// Names and raw values of a tag, up to the first that cannot be read. A name that comes twice is no
/// well-formed XML; looking for such takes time that grows with the square, so the last one wins.
pub(super) fn fields(mut attributes: Attributes<'_>) -> impl Iterator<Item = (&str, Cow<'_, str>)> {
    attributes.with_checks(false);
    attributes.map_while(Result::ok).map(|field| (field.key.into_inner(), field.value))
}

/// A value with its character references resolved, mostly as it stands.
pub(super) fn text(value: Cow<'_, str>) -> Result<Cow<'_, str>, String> {
    if !value.as_bytes().contains(&b'&') {
        return Ok(value);
    }
    let resolved = unescape(&value).map_err(|_| "holds a reference that is not known".to_owned())?;
    Ok(Cow::Owned(resolved.into_owned()))
}

/// One value of `N` numbers.
fn vector<const N: usize>(value: Cow<'_, str>) -> Result<[f64; N], String> {
    let mut values: Vec<[f64; N]> = Vec::new();
    numbers(&text(value)?, &mut values)?;
    match values[..] {
        [one] => Ok(one),
        _ => Err(format!("has {} numbers, not {N}", values.len() * N)),
    }
}

/// SFBool.
pub(super) fn flag(value: &str) -> Result<bool, String> {
    match value.trim() {
        word if word.eq_ignore_ascii_case("true") => Ok(true),
        word if word.eq_ignore_ascii_case("false") => Ok(false),
        word => Err(format!("is {}, neither true nor false", quote(word))),
    }
}

/// All numbers of a text, `N` to a value, into `out`, which loses what it held.
pub(super) fn numbers<const N: usize>(text: &str, out: &mut Vec<[f64; N]>) -> Result<(), String> {
    out.clear();
    let mut rest = text.as_bytes();
    let mut value = [0.0; N];
    let mut filled = 0;
    loop {
        let skipped = rest.iter().position(|b| !is_separator(*b)).unwrap_or(rest.len());
        rest = &rest[skipped..];
        if rest.is_empty() {
            break;
        }
        let (number, length) = fast_float2::parse_partial::<f64, _>(rest).unwrap_or((f64::NAN, 0));
        // NaN fails the comparison too.
        let is_usable = number.abs() <= FLOAT_MAX && rest.get(length).is_none_or(|b| is_separator(*b));
        if !is_usable {
            let end = rest.iter().position(|b| is_separator(*b)).unwrap_or(rest.len());
            let word = String::from_utf8_lossy(&rest[..end]);
            return Err(format!("holds {}, not a number in range", quote(&word)));
        }
        value[filled] = number;
        filled += 1;
        if filled == N {
            out.push(value);
            filled = 0;
        }
        rest = &rest[length..];
    }
    if filled == 0 {
        return Ok(());
    }
    Err(format!("has {} numbers, not a multiple of {N}", out.len() * N + filled))
}

#[inline]
fn is_separator(byte: u8) -> bool {
    matches!(byte, b' ' | b',' | b'\n' | b'\r' | b'\t')
}

/// A text from the file as it may stand in a message: short and on one line.
pub(super) fn quote(text: &str) -> String {
    let shown: String = text.chars().take(SHOWN).collect();
    let more = if shown.len() < text.len() { "..." } else { "" };
    format!("\"{}{more}\"", shown.escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;
    use quick_xml::events::BytesStart;

    fn filled(attributes: &str) -> Result<Extrusion, String> {
        let mut node = Extrusion::default();
        let tag = format!("Extrusion {attributes}");
        node.fill(BytesStart::from_content(&tag, 9).attributes()).map(|_| node)
    }

    #[test]
    fn numbers_in_every_mixture_of_separators() {
        let mut pairs: Vec<[f64; 2]> = vec![[7.0; 2]];
        numbers(" ,1 -2.5,,+3e1\n\t.5\r\n, 6. 1E-3,", &mut pairs).unwrap();
        assert_eq!(pairs, [[1.0, -2.5], [30.0, 0.5], [6.0, 1e-3]]);
        numbers("", &mut pairs).unwrap();
        assert!(pairs.is_empty());
        for (text, what) in [
            ("1 2 3", "has 3 numbers, not a multiple of 2"),
            ("1 2x", "holds \"2x\""),
            ("nan 1", "holds \"nan\""),
            ("1 -inf", "holds \"-inf\""),
            ("1e39 0", "holds \"1e39\""),
            ("1-2 3", "holds \"1-2\""),
            ("\u{e9} 1", "holds \"\u{e9}\""),
            ("- 1", "holds \"-\""),
        ] {
            let told = numbers(text, &mut pairs).unwrap_err();
            assert!(told.contains(what), "{text}: {told}");
        }
    }

    #[test]
    fn fields_of_an_extrusion() {
        assert_eq!(filled("").unwrap(), Extrusion::default());
        let told = filled("x='&no;'").unwrap_err();
        assert!(told.contains("reference"), "{told}");
        let node =
            filled("spine='0 0 0&#10;1&#x20;2 3' endCap=' FALSE ' ccw=\"false\" DEF='a&amp;b'").unwrap();
        assert_eq!(node.spine, [[0.0; 3], [1.0, 2.0, 3.0]]);
        assert_eq!((node.begin_cap, node.end_cap, node.ccw, node.convex), (true, false, false, true));
        assert_eq!(node.def.as_deref(), Some("a&b"));
        let told = filled("convex='yes'").unwrap_err();
        assert_eq!(told, "convex is \"yes\", neither true nor false");
        let told = filled("spine='0 0 0 1 1 1 2 2 2' orientation='0 1 0 0 0 1 0 0'").unwrap_err();
        assert!(told.contains("orientation has 2 values for 3 spine points"), "{told}");
        assert!(filled("scale=''").unwrap_err().contains("scale has 0 values"));
        assert!(filled("scale='1 1 1 -1'").unwrap_err().contains("scale holds -1"));
        // Values beyond the spine's do not count.
        filled("scale='1 1 1 1 0 0'").unwrap();
    }

    #[test]
    fn fields_of_a_transform() {
        let tag = BytesStart::from_content("Transform rotation='0 1 0'", 9);
        assert_eq!(transform(tag.attributes()).unwrap_err(), "rotation has 3 numbers, not a multiple of 4");
        let tag = BytesStart::from_content("Transform scale='1 2 3, 4 5 6'", 9);
        assert_eq!(transform(tag.attributes()).unwrap_err(), "scale has 6 numbers, not 3");
    }
}

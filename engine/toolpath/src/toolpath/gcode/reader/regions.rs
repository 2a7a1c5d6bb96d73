//! What slicers of large machines say in comments, in parentheses or behind a semicolon: layers, the region that a
//! move belongs to, and the width of its bead.

use super::words::number;

/// The meaning of a comment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CommentMeaning {
    /// A layer begins.
    Layer,
    /// What is deposited, and how wide it is, in micrometres or in the file's unit.
    Deposit(&'static str, Option<f64>),
    /// Nothing should be deposited.
    Travel,
}

/// Names of regions; a longer name stands before one that it begins with.
const REGIONS: [&str; 13] = [
    "PERIMETER",
    "INSET",
    "INFILL",
    "TOP_SKIN",
    "BOTTOM_SKIN",
    "SKIN",
    "SUPPORT_ROOF",
    "SUPPORT",
    "RAFT",
    "BRIM",
    "SKIRT",
    "SKELETON",
    "ANCHOR",
];

/// What may stand behind a region's name.
const MODIFIERS: [&[u8]; 13] = [
    b"PRESTART",
    b"INITIAL STARTUP",
    b"SLOW DOWN",
    b"FORWARD TIP WIPE",
    b"REVERSE TIP WIPE",
    b"ANGLED TIP WIPE",
    b"PERIMETER TIP WIPE",
    b"COASTING",
    b"SPIRAL LIFT",
    b"RAMPING UP",
    b"RAMPING DOWN",
    b"LEAD IN",
    b"FLYING START",
];

/// Name of the feature of beads that are deposited although a comment calls the move a travel.
pub(super) const TRAVEL: &str = "TRAVEL";

/// Widths above it are in micrometres; no bead is wider than that in mm or inches.
const MICROMETRES_FROM: f64 = 500.0;

/// Reads a comment without its marks. Regions are in capitals; in lower case other slicers write such words for
/// purposes of their own.
pub(super) fn meaning(text: &[u8], in_parentheses: bool) -> Option<CommentMeaning> {
    let text = text.trim_ascii();
    match text.first()? {
        b'B' | b'b' if starts_with(text, b"BEGINNING LAYER") => Some(CommentMeaning::Layer),
        b'L' | b'l' if in_parentheses && numbers_layer(text) => Some(CommentMeaning::Layer),
        b'T' if text.starts_with(TRAVEL.as_bytes()) => {
            let rest = &text[TRAVEL.len()..];
            (rest.is_empty() || rest[0] == b' ').then_some(CommentMeaning::Travel)
        }
        b'A'..=b'Z' => region(text.strip_prefix(b"AD-").unwrap_or(text)),
        _ => None,
    }
}

fn region(text: &[u8]) -> Option<CommentMeaning> {
    let name = REGIONS.into_iter().find(|name| text.starts_with(name.as_bytes()))?;
    let rest = &text[name.len()..];
    let (width, rest) = match rest.trim_ascii_start().strip_prefix(b"-") {
        None => (None, rest),
        Some(behind) => {
            let behind = behind.trim_ascii_start();
            let found = number(behind)?;
            (Some(found.value), &behind[found.length..])
        }
    };
    let is_modifier = |text: &[u8]| MODIFIERS.iter().any(|known| text.starts_with(known));
    let fits = rest.is_empty() || (rest[0] == b' ' && is_modifier(rest.trim_ascii_start()));
    fits.then_some(CommentMeaning::Deposit(name, width))
}

/// `LAYER 3`, `Layer: 3`, `LAYER = 3`, `LAYER #3`.
fn numbers_layer(text: &[u8]) -> bool {
    if !starts_with(text, b"LAYER") {
        return false;
    }
    let rest = &text[5..];
    let digits = rest.trim_ascii_start();
    let digits = digits.strip_prefix(b":").or_else(|| digits.strip_prefix(b"=")).unwrap_or(digits);
    let digits = digits.trim_ascii_start();
    let digits = digits.strip_prefix(b"#").unwrap_or(digits);
    digits.len() < rest.len() && !digits.is_empty() && digits.iter().all(u8::is_ascii_digit)
}

fn starts_with(text: &[u8], key: &[u8]) -> bool {
    text.get(..key.len()).is_some_and(|start| start.eq_ignore_ascii_case(key))
}

/// A width in mm as a region's comment states it, where the file counts in units of so many mm.
pub(super) fn width(stated: f64, unit: f64) -> Option<f64> {
    let width = if stated > MICROMETRES_FROM { stated / 1000.0 } else { stated * unit };
    (width > 0.0 && width <= super::SIZE_MAX).then_some(width)
}

/// Comments of a line, without their marks, each with whether it stands in parentheses.
pub(super) fn comments(line: &[u8]) -> impl Iterator<Item = (&[u8], bool)> {
    let mut rest = line;
    std::iter::from_fn(move || {
        let at = memchr::memchr2(b'(', b';', rest)?;
        let text = &rest[at + 1..];
        if rest[at] == b';' {
            rest = b"";
            return Some((text, false));
        }
        let close = text.iter().position(|b| *b == b')').unwrap_or(text.len());
        rest = text.get(close + 1..).unwrap_or_default();
        Some((&text[..close], true))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_layers_and_widths() {
        for (text, expected) in [
            ("BEGINNING LAYER: 12", Some(CommentMeaning::Layer)),
            ("LAYER 3", Some(CommentMeaning::Layer)),
            ("Layer: 3", Some(CommentMeaning::Layer)),
            ("LAYER #3", Some(CommentMeaning::Layer)),
            ("LAYER=3", Some(CommentMeaning::Layer)),
            ("LAYER COUNT: 2", None),
            ("LAYER HEIGHT: 2", None),
            ("LAYER", None),
            ("LAYERS 3", None),
            ("PERIMETER", Some(CommentMeaning::Deposit("PERIMETER", None))),
            (" SKIN SLOW DOWN ", Some(CommentMeaning::Deposit("SKIN", None))),
            ("SUPPORT_ROOF", Some(CommentMeaning::Deposit("SUPPORT_ROOF", None))),
            ("SKELETON-0.1234", Some(CommentMeaning::Deposit("SKELETON", Some(0.1234)))),
            ("SKELETON-12700.5 PRESTART", Some(CommentMeaning::Deposit("SKELETON", Some(12700.5)))),
            ("SKELETON - 0.5", Some(CommentMeaning::Deposit("SKELETON", Some(0.5)))),
            ("AD-SKELETON-5", Some(CommentMeaning::Deposit("SKELETON", Some(5.0)))),
            ("PERIMETER SPINDLE ADJUSTMENT", None),
            ("PERIMETERS", None),
            ("SKELETON-x", None),
            ("perimeter", None),
            ("Perimeter Count: 2", None),
            ("TRAVEL", Some(CommentMeaning::Travel)),
            ("TRAVEL LIFT Z", Some(CommentMeaning::Travel)),
            ("TRAVELLER", None),
            ("", None),
        ] {
            assert_eq!(meaning(text.as_bytes(), true), expected, "{text}");
        }
        assert_eq!(meaning(b"LAYER 3", false), None);
        assert_eq!([width(0.5, 25.4), width(12700.0, 25.4), width(0.0, 1.0)], [Some(12.7), Some(12.7), None]);
    }

    #[test]
    fn a_line_has_many_comments() {
        let found: Vec<_> = comments(b"G1 (a) X1 (b) ; c (d)").collect();
        assert_eq!(found, [(&b"a"[..], true), (b"b", true), (b" c (d)", false)]);
        assert_eq!(comments(b"(open").collect::<Vec<_>>(), [(&b"open"[..], true)]);
        assert_eq!(comments(b"G1 X1").count(), 0);
    }
}

//! What slicers say in comments: PrusaSlicer, SuperSlicer, OrcaSlicer, Bambu Studio, Cura, Slic3r, Simplify3D,
//! KISSlicer, ideaMaker.

use super::settings::size;

/// The meaning of a comment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Comment<'a> {
    /// The kind of deposition that follows.
    Feature(&'a [u8]),
    /// Width of the beads that follow, in mm; `None` if it is no size.
    Width(Option<f64>),
    /// Height of the beads that follow, in mm; `None` if it is no size.
    Height(Option<f64>),
    /// A layer begins.
    Layer,
    /// The mesh that the following beads belong to.
    Mesh(&'a [u8]),
    /// Nothing that matters.
    Other,
}

/// Reads a comment, from its semicolon.
pub(super) fn meaning(comment: &[u8]) -> Comment<'_> {
    let text = comment[1..].trim_ascii();
    let after = |key: &[u8]| text.strip_prefix(key).map(<[u8]>::trim_ascii);
    match text.first() {
        Some(b'T') => after(b"TYPE:").map_or(Comment::Other, Comment::Feature),
        Some(b'F') => after(b"FEATURE:").map_or(Comment::Other, Comment::Feature),
        Some(b'W') => after(b"WIDTH:").map_or(Comment::Other, |value| Comment::Width(size(value))),
        Some(b'H') => after(b"HEIGHT:").map_or(Comment::Other, |value| Comment::Height(size(value))),
        Some(b'M') => after(b"MESH:").map_or(Comment::Other, Comment::Mesh),
        Some(b'C') if text == b"CHANGE_LAYER" => Comment::Layer,
        // KISSlicer: "BEGIN_LAYER_OBJECT z=0.25 z_thickness=0.25" and "'Perimeter Path', 0.6 [feed mm/s], ...".
        Some(b'B') if text.starts_with(b"BEGIN_LAYER_") => Comment::Layer,
        Some(b'\'') => quoted(text).map_or(Comment::Other, Comment::Feature),
        // Simplify3D: "layer 1, Z = 0.200", "feature outer perimeter" and "tool H0.200 W0.480".
        Some(b'l')
            if after(b"layer ").and_then(super::words::number).is_some()
                && memchr::memmem::find(text, b", Z = ").is_some() =>
        {
            Comment::Layer
        }
        Some(b'f') => after(b"feature ").map_or(Comment::Other, Comment::Feature),
        Some(b't') => after(b"tool H").map_or(Comment::Other, tool_size),
        Some(b'L') => layer_or_line(text),
        _ => Comment::Other,
    }
}

/// What stands between single quotes at the front, if a comma follows.
fn quoted(text: &[u8]) -> Option<&[u8]> {
    let end = text[1..].iter().position(|b| *b == b'\'')?;
    text[end + 2..].starts_with(b",").then(|| &text[1..=end])
}

/// The height. The width behind it is that of a rectangle of the volume fed, not of the bead.
fn tool_size(text: &[u8]) -> Comment<'_> {
    let height = text.split(|b| *b == b' ').next().unwrap_or(text);
    Comment::Height(size(height))
}

fn layer_or_line(text: &[u8]) -> Comment<'_> {
    if text == b"LAYER_CHANGE" {
        return Comment::Layer;
    }
    if let Some(layer) = text.strip_prefix(b"LAYER:") {
        let is_number = super::words::number(layer.trim_ascii()).is_some();
        return if is_number { Comment::Layer } else { Comment::Other };
    }
    if let Some(width) = text.strip_prefix(b"LINE_WIDTH:") {
        return Comment::Width(size(width.trim_ascii()));
    }
    if let Some(height) = text.strip_prefix(b"LAYER_HEIGHT:") {
        return Comment::Height(size(height.trim_ascii()));
    }
    Comment::Other
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slicer_is_understood() {
        for (comment, expected) in [
            (&b";TYPE:External perimeter"[..], Comment::Feature(b"External perimeter")),
            (b"; FEATURE: Outer wall", Comment::Feature(b"Outer wall")),
            (b";WIDTH:0.45", Comment::Width(Some(0.45))),
            (b"; LINE_WIDTH: 0.42", Comment::Width(Some(0.42))),
            (b";WIDTH:-1", Comment::Width(None)),
            (b";WIDTH:1mm", Comment::Width(Some(1.0))),
            (b";WIDTH:1in", Comment::Width(None)),
            (b";HEIGHT:1.5", Comment::Height(Some(1.5))),
            (b"; LAYER_HEIGHT: 0.2", Comment::Height(Some(0.2))),
            (b";LAYER_CHANGE", Comment::Layer),
            (b"; CHANGE_LAYER", Comment::Layer),
            (b";LAYER:-3", Comment::Layer),
            (b";LAYER_COUNT:252", Comment::Other),
            (b";Layer height: 0.1", Comment::Other),
            (b";MESH:clover.stl", Comment::Mesh(b"clover.stl")),
            (b"; layer 1, Z = 0.200", Comment::Layer),
            (b"; layer end", Comment::Other),
            (b"; layer_height = 0.2", Comment::Other),
            (b"; feature outer perimeter", Comment::Feature(b"outer perimeter")),
            (b"; tool H0.200 W0.480", Comment::Height(Some(0.2))),
            (b"; BEGIN_LAYER_OBJECT z=0.263 z_thickness=0.263", Comment::Layer),
            (b"; END_LAYER_OBJECT z=0.263", Comment::Other),
            (b"; 'Perimeter Path', 0.6 [feed mm/s], 9.5 [head mm/s]", Comment::Feature(b"Perimeter Path")),
            (b"; 'quoted' words", Comment::Other),
            (b"; '", Comment::Other),
            (b";", Comment::Other),
        ] {
            assert_eq!(meaning(comment), expected, "{}", String::from_utf8_lossy(comment));
        }
    }
}

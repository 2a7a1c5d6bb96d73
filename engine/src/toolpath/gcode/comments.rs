//! What slicers say in comments: PrusaSlicer, SuperSlicer, OrcaSlicer, Bambu Studio, Cura, Slic3r.

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
        Some(b'L') => layer_or_line(text),
        _ => Comment::Other,
    }
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

/// A length in mm that a bead can have.
fn size(text: &[u8]) -> Option<f64> {
    let found = super::words::number(text)?;
    (found.length == text.len() && found.value > 0.0 && found.value <= super::SIZE_MAX).then_some(found.value)
}

/// What the slicer's settings say, wherever in the file they stand.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Settings {
    /// Filament diameter of each tool, in mm.
    pub(super) filament_diameters: Vec<f64>,
    /// E counts mm³ instead of mm of filament.
    pub(super) volumetric: bool,
    /// The usual layer height, in mm.
    pub(super) layer_height: Option<f64>,
}

impl Settings {
    /// Takes in a comment, from its semicolon. A setting reads `; key = value` or `; key: value`.
    pub(super) fn read(&mut self, comment: &[u8]) {
        let text = comment[1..].trim_ascii_start();
        // Nearly every comment ends here: the keys begin with these letters.
        if !matches!(text.first(), Some(b'f' | b'u' | b'l' | b'L')) {
            return;
        }
        let Some(split) = text.iter().position(|b| matches!(b, b'=' | b':')) else { return };
        let (key, value) = (text[..split].trim_ascii(), text[split + 1..].trim_ascii());
        match key {
            b"filament_diameter" => {
                let sizes: Option<Vec<f64>> =
                    value.split(|b| matches!(b, b',' | b';')).map(|v| size(v.trim_ascii())).collect();
                self.filament_diameters = sizes.unwrap_or_default();
            }
            b"use_volumetric_e" => self.volumetric = value == b"1",
            b"layer_height" | b"Layer height" => self.layer_height = size(value),
            _ => {}
        }
    }
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
            (b";WIDTH:1mm", Comment::Width(None)),
            (b";HEIGHT:1.5", Comment::Height(Some(1.5))),
            (b"; LAYER_HEIGHT: 0.2", Comment::Height(Some(0.2))),
            (b";LAYER_CHANGE", Comment::Layer),
            (b"; CHANGE_LAYER", Comment::Layer),
            (b";LAYER:-3", Comment::Layer),
            (b";LAYER_COUNT:252", Comment::Other),
            (b";Layer height: 0.1", Comment::Other),
            (b";MESH:clover.stl", Comment::Mesh(b"clover.stl")),
            (b";", Comment::Other),
        ] {
            assert_eq!(meaning(comment), expected, "{}", String::from_utf8_lossy(comment));
        }
    }

    #[test]
    fn settings_stand_in_lists() {
        let mut settings = Settings::default();
        for line in
            [&b"; filament_diameter = 1.75,2.85"[..], b"; use_volumetric_e = 1", b";Layer height: 0.1", b";"]
        {
            settings.read(line);
        }
        let filament_diameters = vec![1.75, 2.85];
        assert_eq!(settings, Settings { filament_diameters, volumetric: true, layer_height: Some(0.1) });
        settings.read(b"; filament_diameter = 1.75,x");
        assert!(settings.filament_diameters.is_empty());
    }
}

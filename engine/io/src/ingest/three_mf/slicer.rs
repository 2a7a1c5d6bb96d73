//! What slicers keep beside the models of a 3MF file: which parts of an object are not solid.
//!
//! PrusaSlicer and its like name ranges of triangles (`Metadata/Slic3r_PE_model.config`); Bambu Studio and OrcaSlicer name
//! components (`Metadata/model_settings.config`).

use crate::ingest::xml::attribute;
use quick_xml::Reader;
use quick_xml::events::Event;
use std::collections::HashMap;

/// What a part of an object is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum PartRole {
    #[default]
    Solid,
    /// Changes settings within it.
    Modifier,
    /// Support, or where it may be or not.
    Support,
    /// Is subtracted.
    Negative,
}

impl PartRole {
    /// By the names of both families.
    fn named(name: &str) -> PartRole {
        match name {
            "ParameterModifier" | "modifier_part" => PartRole::Modifier,
            "SupportBlocker" | "SupportEnforcer" | "support_blocker" | "support_enforcer" => {
                PartRole::Support
            }
            "NegativeVolume" | "negative_part" => PartRole::Negative,
            _ => PartRole::Solid,
        }
    }
}

/// The parts that are not solid.
#[derive(Debug, Default)]
pub(super) struct NonSolidParts {
    /// By an object and one of its components.
    components: HashMap<(String, String), PartRole>,
    /// Ranges of triangles of an object, ends included.
    ranges: HashMap<String, Vec<(usize, usize, PartRole)>>,
}

impl NonSolidParts {
    /// Whether a file of the archive tells of parts.
    pub(super) fn is_told_in(name: &str) -> bool {
        ["Metadata/Slic3r_PE_model.config", "Metadata/model_settings.config"].contains(&name)
    }

    /// Takes in such a file; what is not understood is passed over, since it says nothing of the surface.
    pub(super) fn read(&mut self, text: &str) {
        let mut xml = Reader::from_str(text);
        let (mut object, mut range) = (String::new(), None);
        while let Ok(event) = xml.read_event() {
            let (Event::Start(tag) | Event::Empty(tag)) = &event else {
                if event == Event::Eof {
                    return;
                }
                continue;
            };
            let field = |wanted: &str| attribute(tag, wanted);
            let index = |name: &str| field(name).and_then(|text| text.parse::<usize>().ok());
            match tag.local_name().as_ref() {
                "object" => (object, range) = (field("id").unwrap_or_default(), None),
                "part" => {
                    let part = PartRole::named(&field("subtype").unwrap_or_default());
                    if part != PartRole::Solid {
                        self.components.insert((object.clone(), field("id").unwrap_or_default()), part);
                    }
                }
                "volume" => range = index("firstid").zip(index("lastid")),
                "metadata" => {
                    let (key, value) = (field("key").unwrap_or_default(), field("value").unwrap_or_default());
                    let part = match &key[..] {
                        "volume_type" => PartRole::named(&value),
                        "modifier" if value == "1" => PartRole::Modifier,
                        _ => continue,
                    };
                    if let (Some((first, last)), true) = (range, part != PartRole::Solid) {
                        let ranges = self.ranges.entry(object.clone()).or_default();
                        // Older files say it twice.
                        if ranges.last().is_none_or(|&(before, ..)| before != first) {
                            ranges.push((first, last, part));
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// What a component of an object is.
    pub(super) fn component(&self, object: &str, component: &str) -> PartRole {
        self.components.get(&(object.to_owned(), component.to_owned())).copied().unwrap_or_default()
    }

    /// What a triangle of an object belongs to.
    pub(super) fn triangle(&self, object: &str, number: usize) -> PartRole {
        let Some(ranges) = self.ranges.get(object) else { return PartRole::Solid };
        let range = ranges.iter().find(|(first, last, _)| (*first..=*last).contains(&number));
        range.map_or(PartRole::Solid, |(_, _, part)| *part)
    }

    /// The parts of an object that are ranges of its triangles.
    pub(super) fn ranges(&self, object: &str) -> impl Iterator<Item = PartRole> {
        self.ranges.get(object).into_iter().flatten().map(|(_, _, part)| *part)
    }
}

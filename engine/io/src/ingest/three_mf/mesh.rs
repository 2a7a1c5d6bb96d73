//! The meshes of a 3MF file, each where it stands on the plate, in millimetres (3MF Consortium, Core Specification 1.3 and
//! Production Extension 1.1).
//!
//! What slicers keep beside the models tells which parts are none: modifiers, and bodies that are to be subtracted.

use super::archive::{Archive, damaged};
use super::slicer::{NonSolidParts, PartRole};
use crate::error::Result;
use crate::ingest::placement::{Placement, SceneLimit};
use crate::ingest::polygons::Polygons;
use crate::ingest::xml::attribute;
use crate::progress::Progress;
use quick_xml::events::{BytesStart, Event};
use std::collections::HashMap;
use std::path::Path;

/// How deep components of components go at most.
const DEPTH_MAX: usize = 32;
/// How often objects may stand on the plate or in each other, for each that there is.
const COPIES_MAX: usize = 1000;
/// A model's file and an object's number in it.
type Key = (String, String);

/// Reads the meshes of what is built.
///
/// # Errors
/// If it is no ZIP archive with a model; if a model is no well-formed XML, names a vertex or an object that is not there, or
/// unpacks to far more than any model does; if the user interrupts.
pub(in crate::ingest) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Polygons> {
    let mut archive = Archive::open(path, bytes)?;
    let mut scene = Scene { main: archive.main().to_owned(), ..Scene::default() };
    let mut current: Option<(Key, Object)> = None;
    archive.walk(progress, &mut |model, event| {
        match event {
            Event::Start(tag) | Event::Empty(tag) => return scene.element(model, tag, &mut current),
            Event::End(tag) if tag.local_name().as_ref() == "object" => scene.close(current.take()),
            Event::Eof => scene.close(current.take()),
            _ => {}
        }
        Ok(())
    })?;
    let mut parts = NonSolidParts::default();
    let told: Vec<String> =
        archive.names().iter().filter(|name| NonSolidParts::is_told_in(name)).cloned().collect();
    for name in told {
        parts.read(&archive.text(&name)?);
    }
    scene.build(&parts).map_err(|what| damaged(path, archive.main(), &what))
}

/// A mesh, and other objects that stand in it.
#[derive(Default)]
struct Object {
    kind: String,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    components: Vec<(Key, Placement)>,
}

/// All objects, and what is built of them.
#[derive(Default)]
struct Scene {
    main: String,
    objects: HashMap<Key, Object>,
    /// Keys in the order of the file.
    order: Vec<Key>,
    items: Vec<(Key, Placement)>,
    /// Millimetres in the unit of each model.
    scale: HashMap<String, f64>,
}

impl Scene {
    /// Keeps an object that is complete.
    fn close(&mut self, object: Option<(Key, Object)>) {
        if let Some((key, object)) = object {
            self.order.push(key.clone());
            self.objects.insert(key, object);
        }
    }

    fn element(
        &mut self,
        model: &str,
        tag: &BytesStart<'_>,
        current: &mut Option<(Key, Object)>,
    ) -> std::result::Result<(), String> {
        let field = |wanted: &str| attribute(tag, wanted);
        let wanted = |name: &str| field(name).ok_or_else(|| format!("an element has no {name}"));
        // Another model's object is named by its file, too.
        let key = || -> std::result::Result<Key, String> {
            let file = field("path")
                .map_or_else(|| model.to_owned(), |path| path.trim_start_matches('/').to_owned());
            Ok((file, wanted("objectid")?))
        };
        let place = || field("transform").map_or(Ok(Placement::IDENTITY), |text| placement(&text));
        match (tag.local_name().as_ref(), current) {
            ("model", _) => {
                let unit = field("unit").unwrap_or_else(|| "millimeter".to_owned());
                self.scale.insert(model.to_owned(), millimetres(&unit)?);
            }
            ("object", current) => {
                let kind = field("type").unwrap_or_else(|| "model".to_owned());
                let before = current
                    .replace(((model.to_owned(), wanted("id")?), Object { kind, ..Object::default() }));
                self.close(before);
            }
            ("vertex", Some((_, object))) => {
                let mut at = [0.0; 3];
                for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                    let text = wanted(name)?;
                    at[axis] = number(&text)?;
                }
                object.vertices.push(at);
            }
            ("triangle", Some(((_, id), object))) => {
                let mut corners = [0; 3];
                for (corner, name) in ["v1", "v2", "v3"].into_iter().enumerate() {
                    let text = wanted(name)?;
                    let is_there = |n: &u32| (*n as usize) < object.vertices.len();
                    let found = text.trim().parse().ok().filter(is_there);
                    corners[corner] = found.ok_or_else(|| format!("object {id} has no vertex \"{text}\""))?;
                }
                object.triangles.push(corners);
            }
            ("component", Some((_, object))) => object.components.push((key()?, place()?)),
            ("item", _) if model == self.main => self.items.push((key()?, place()?)),
            _ => {}
        }
        Ok(())
    }

    /// The meshes of all items.
    fn build(&self, parts: &NonSolidParts) -> std::result::Result<Polygons, String> {
        let held = self.objects.values().map(|object| object.vertices.len() + object.triangles.len()).sum();
        let polygons = Polygons::default();
        let mut built = MeshInProgress {
            scene: self,
            parts,
            polygons,
            room: SceneLimit::of(held),
            placed: 0,
            left_out: [0; 4],
        };
        let scale = |key: &Key| Placement::scale([self.scale.get(&key.0).copied().unwrap_or(1.0); 3]);
        for (key, place) in &self.items {
            // A placement is in the unit of the model that names it.
            let unit = self.scale.get(&self.main).copied().unwrap_or(1.0);
            built.add(key, &Placement::scale([unit; 3]).after(place), None, 0)?;
        }
        if self.items.is_empty() {
            let inner = self.objects.values().flat_map(|object| object.components.iter().map(|(key, _)| key));
            let inner = inner.collect::<std::collections::HashSet<_>>();
            for key in self.order.iter().filter(|key| !inner.contains(key)) {
                built.add(key, &scale(key), None, 0)?;
            }
            let what = "names nothing to build: all objects are read, where they were modelled";
            built.polygons.warnings.push(what.to_owned());
        }
        built.tell();
        built.polygons.finish();
        Ok(built.polygons)
    }
}

/// What is built so far.
struct MeshInProgress<'a> {
    scene: &'a Scene,
    parts: &'a NonSolidParts,
    polygons: Polygons,
    room: SceneLimit,
    /// Objects that were placed.
    placed: usize,
    /// How many of each kind of part were left out.
    left_out: [usize; 4],
}

impl MeshInProgress<'_> {
    /// Adds an object that stands in `parent`.
    fn add(
        &mut self,
        key: &Key,
        at: &Placement,
        parent: Option<&Key>,
        depth: usize,
    ) -> std::result::Result<(), String> {
        let object = self
            .scene
            .objects
            .get(key)
            .ok_or_else(|| format!("there is no object {} in {}", key.1, key.0))?;
        if depth > DEPTH_MAX {
            return Err(format!("object {} is a component of itself", key.1));
        }
        const MANY: &str = "its objects stand on the plate more often than can be read";
        self.placed += 1;
        if self.placed > COPIES_MAX * self.scene.objects.len() {
            return Err(MANY.to_owned());
        }
        let part = match (&object.kind[..], parent) {
            ("support" | "solidsupport", _) => PartRole::Support,
            (_, Some(parent)) => self.parts.component(&parent.1, &key.1),
            _ => PartRole::Solid,
        };
        if part != PartRole::Solid {
            self.left_out[part as usize] += 1;
            return Ok(());
        }
        let is_solid = |n: &usize| self.parts.triangle(&key.1, *n) == PartRole::Solid;
        let chosen = (0..object.triangles.len()).filter(is_solid).map(|n| object.triangles[n]);
        let fits = self.polygons.add_placed(&object.vertices, chosen, at, self.room);
        for part in self.parts.ranges(&key.1) {
            self.left_out[part as usize] += 1;
        }
        if !fits {
            return Err(MANY.to_owned());
        }
        object
            .components
            .iter()
            .try_for_each(|(inner, place)| self.add(inner, &at.after(place), Some(key), depth + 1))
    }

    /// Tells what was left out.
    fn tell(&mut self) {
        for (part, what) in [
            (PartRole::Modifier, "modifiers of settings"),
            (PartRole::Support, "supports, or where they may be"),
            (PartRole::Negative, "bodies that the slicer subtracts"),
        ] {
            let count = self.left_out[part as usize];
            if count > 0 {
                self.polygons.warnings.push(format!("{count} parts are left out: {what}"));
            }
        }
    }
}

/// Millimetres in a unit of the specification.
fn millimetres(unit: &str) -> std::result::Result<f64, String> {
    Ok(match unit {
        "micron" => 0.001,
        "millimeter" => 1.0,
        "centimeter" => 10.0,
        "inch" => 25.4,
        "foot" => 304.8,
        "meter" => 1000.0,
        other => return Err(format!("\"{other}\" is no unit of length")),
    })
}

fn number(text: &str) -> std::result::Result<f64, String> {
    let number = fast_float2::parse::<f64, _>(text.trim()).ok().filter(|n| n.is_finite());
    number.ok_or_else(|| format!("\"{text}\" is not a number"))
}

/// Twelve numbers: the images of x, y and z, and what is added.
fn placement(text: &str) -> std::result::Result<Placement, String> {
    let numbers = text.split_ascii_whitespace().map(number).collect::<std::result::Result<Vec<_>, _>>()?;
    let numbers: [f64; 12] =
        numbers.try_into().map_err(|_| format!("the placement \"{text}\" has not twelve numbers"))?;
    Ok(Placement(std::array::from_fn(|row| std::array::from_fn(|column| numbers[3 * column + row]))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use std::io::{Cursor, Write};
    use zip::write::{SimpleFileOptions, ZipWriter};

    const MAIN: &str = "3D/3dmodel.model";
    const MESH: &str = "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" \
        y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"/></vertices><triangles><triangle v1=\"0\" v2=\"2\" v3=\"1\"/>\
        <triangle v1=\"0\" v2=\"1\" v3=\"3\"/><triangle v1=\"1\" v2=\"2\" v3=\"3\"/><triangle v1=\"0\" v2=\"3\" v3=\"2\"/>\
        </triangles></mesh>";

    fn of(files: &[(&str, &str)]) -> Result<Polygons> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, text) in files {
            zip.start_file(*name, SimpleFileOptions::default()).unwrap();
            zip.write_all(text.as_bytes()).unwrap();
        }
        read(Path::new("a.3mf"), zip.finish().unwrap().get_ref(), &Silent)
    }

    fn model(unit: &str, resources: &str, build: &str) -> String {
        format!(
            "<model unit=\"{unit}\" xmlns:p=\"p\"><resources>{resources}</resources><build>{build}</build></model>"
        )
    }

    /// Six times the volume.
    fn sixfold(polygons: &Polygons) -> f64 {
        let at = |n: u32| polygons.vertices[n as usize];
        let of_one = |t: &[u32; 3]| {
            let [a, b, c] = t.map(at);
            a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
        };
        polygons.triangles.iter().map(of_one).sum()
    }

    #[test]
    fn items_and_components_stand_where_they_are_placed() {
        let object = format!("<object id=\"1\">{MESH}</object>");
        let group = "<object id=\"2\"><components><component objectid=\"1\" transform=\"2 0 0 0 2 0 0 0 2 0 0 0\"/>\
            <component objectid=\"1\" transform=\"-1 0 0 0 1 0 0 0 1 -5 0 0\"/></components></object>";
        let item = "<item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 10 20 30\"/>";
        let found = of(&[(MAIN, &model("centimeter", &(object + group), item))]).unwrap();
        assert_eq!((found.triangles.len(), found.vertices[0]), (8, [100.0, 200.0, 300.0]));
        // Mirrored parts enclose a volume, too.
        assert!((sixfold(&found) - 9000.0).abs() < 1e-6, "{}", sixfold(&found));
        assert!(found.warnings.is_empty());
    }

    #[test]
    fn objects_of_other_models_are_found() {
        let part = model("millimeter", &format!("<object id=\"4\">{MESH}</object>"), "");
        let group = "<object id=\"1\"><components><component p:path=\"/3D/Objects/a.model\" objectid=\"4\"/></components>\
            </object>";
        let files = [
            (MAIN, &model("millimeter", group, "<item objectid=\"1\"/>")[..]),
            ("3D/Objects/a.model", &part),
        ];
        let found = of(&files).unwrap();
        assert_eq!((found.triangles.len(), sixfold(&found)), (4, 1.0));
        // Without anything to build all that is no part of another is read.
        let found = of(&[(MAIN, &model("inch", &format!("<object id=\"4\">{MESH}</object>"), ""))]).unwrap();
        assert!((sixfold(&found) - 25.4f64.powi(3)).abs() < 1e-9);
        assert!(found.warnings[0].contains("names nothing to build"));
    }

    #[test]
    fn parts_that_slicers_mark_are_left_out_and_told() {
        let resources = format!(
            "<object id=\"1\">{MESH}</object><object id=\"2\">{MESH}</object><object id=\"3\" type=\"support\">{MESH}</object>\
             <object id=\"9\"><components><component objectid=\"1\"/><component objectid=\"2\"/></components></object>"
        );
        let build = "<item objectid=\"9\"/><item objectid=\"3\"/>";
        let bambu = "<config><object id=\"9\"><part id=\"1\" subtype=\"normal_part\"/><part id=\"2\" \
            subtype=\"negative_part\"/></object></config>";
        let files =
            [(MAIN, &model("millimeter", &resources, build)[..]), ("Metadata/model_settings.config", bambu)];
        let found = of(&files).unwrap();
        assert_eq!(found.triangles.len(), 4);
        assert!(
            found.warnings.iter().any(|told| told.contains("the slicer subtracts")),
            "{:?}",
            found.warnings
        );
        assert!(found.warnings.iter().any(|told| told.contains("supports")), "{:?}", found.warnings);
        let prusa = "<config><object id=\"1\"><volume firstid=\"0\" lastid=\"2\"><metadata type=\"volume\" \
            key=\"volume_type\" value=\"ModelPart\"/></volume><volume firstid=\"3\" lastid=\"3\"><metadata type=\"volume\" \
            key=\"modifier\" value=\"1\"/><metadata type=\"volume\" key=\"volume_type\" value=\"ParameterModifier\"/>\
            </volume></object></config>";
        let one = model("millimeter", &format!("<object id=\"1\">{MESH}</object>"), "<item objectid=\"1\"/>");
        let found = of(&[(MAIN, &one), ("Metadata/Slic3r_PE_model.config", prusa)]).unwrap();
        assert_eq!(found.triangles.len(), 3);
        assert_eq!(found.warnings, ["1 parts are left out: modifiers of settings"]);
    }

    #[test]
    fn what_is_wrong_is_told_in_a_line() {
        let itself = "<object id=\"1\"><components><component objectid=\"1\"/></components></object>";
        let double = (1..40).map(|n| {
            let component = format!("<component objectid=\"{n}\"/>");
            format!("<object id=\"{}\"><components>{component}{component}</components></object>", n + 1)
        });
        let double = double.take(25).collect::<String>();
        let many = format!("<object id=\"1\">{MESH}</object>{double}");
        let nothing = format!("<object id=\"1\"/>{double}");
        for (resources, item, what) in [
            ("", "<item objectid=\"7\"/>", "there is no object 7"),
            (itself, "<item objectid=\"1\"/>", "is a component of itself"),
            (&many[..], "<item objectid=\"26\"/>", "more often than can be read"),
            (&nothing[..], "<item objectid=\"26\"/>", "more often than can be read"),
            (
                "<object id=\"1\"><mesh><triangles><triangle v1=\"0\" v2=\"0\" v3=\"0\"/></triangles></mesh></object>",
                "",
                "has no vertex",
            ),
            (
                "<object id=\"1\"><mesh><vertices><vertex x=\"a\" y=\"0\" z=\"0\"/></vertices></mesh></object>",
                "",
                "is not a number",
            ),
            ("", "<item objectid=\"1\" transform=\"1 2\"/>", "has not twelve numbers"),
        ] {
            let said = of(&[(MAIN, &model("millimeter", resources, item))]).unwrap_err().to_string();
            assert!(said.contains(what) && !said.contains('\n'), "{said}");
        }
        let said = of(&[(MAIN, &model("furlong", "", ""))]).unwrap_err().to_string();
        assert!(said.contains("is no unit of length"), "{said}");
    }
}

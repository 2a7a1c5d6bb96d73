//! AMF meshes (ISO/ASTM 52915), as text or in a ZIP archive, in millimetres.
//!
//! Objects stand where the constellations place them; without a constellation each stands once where it was modelled.
//! Volumes that a slicer has marked as modifiers are left out.

use super::placement::{Placement, SceneLimit};
use super::polygons::Polygons;
use super::xml::attribute;
use crate::error::{Error, Result};
use crate::progress::Progress;
use quick_xml::Reader;
use quick_xml::events::Event;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;
use zip::ZipArchive;

/// Most that a byte of an archive may become, and what any archive may.
const RATIO_MAX: u64 = 200;
const TEXT_BYTES: u64 = 1 << 24;
/// Largest element or text between two.
const ELEMENT_BYTES_MAX: usize = 1 << 20;
const REMEDY: &str = "export or copy the file again";

/// Reads all objects. `bytes` is the XML, or a ZIP archive with one.
///
/// # Errors
/// If it is no sound archive or no well-formed XML, has a number that is none, or names a vertex or an object that is not
/// there; if the user interrupts.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Polygons> {
    let damaged = |what: String| Error::input(path, "AMF", super::text::plain(what.as_bytes()), REMEDY);
    if !bytes.starts_with(b"PK") {
        return Scene::read(bytes, progress)?.map_err(damaged);
    }
    let sound = |error: zip::result::ZipError| damaged(format!("is no sound ZIP archive: {error}"));
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(sound)?;
    let names = archive.file_names().filter_map(|name| Some(name.ok()?.into_owned())).collect::<Vec<_>>();
    let Some(name) = names.iter().find(|name| name.to_ascii_lowercase().ends_with(".amf")) else {
        return Err(damaged("the archive holds no file .amf".to_owned()));
    };
    let entry = archive.by_name(name).map_err(sound)?;
    let most = TEXT_BYTES.max(entry.compressed_size().saturating_mul(RATIO_MAX));
    Scene::read(BufReader::new(entry.take(most)), progress)?.map_err(damaged)
}

/// An object: its vertices, and the triangles of its volumes.
#[derive(Default)]
struct Object {
    id: String,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// An object's place: shift, turns in degrees, factors.
#[derive(Clone)]
struct Instance {
    object: String,
    shift: [f64; 3],
    turns: [f64; 3],
    factors: [f64; 3],
}

#[derive(Default)]
struct Scene {
    scale: Option<f64>,
    objects: Vec<Object>,
    instances: Vec<Instance>,
    /// Where the current volume's triangles begin, and whether it is a modifier.
    volume: (usize, bool),
    modifiers: usize,
    vertex: [f64; 3],
    triangle: [u32; 3],
    /// The kind of the metadata that is open.
    metadata: String,
}

impl Scene {
    fn read(
        text: impl std::io::BufRead,
        progress: &dyn Progress,
    ) -> Result<std::result::Result<Polygons, String>> {
        let mut xml = Reader::from_reader(text);
        let (mut scene, mut buffer, mut said, mut events) =
            (Scene::default(), Vec::new(), String::new(), 0u32);
        loop {
            buffer.clear();
            events += 1;
            if events.is_multiple_of(1 << 16) {
                progress.check()?;
            }
            let event = match xml.read_event_into(&mut buffer) {
                Ok(event) => event,
                Err(error) => return Ok(Err(format!("is no well-formed XML: {error}"))),
            };
            let done = match &event {
                Event::Start(tag) => {
                    said.clear();
                    scene.begin(tag)
                }
                Event::Empty(tag) => scene.begin(tag).and_then(|()| scene.end(tag.local_name().as_ref(), "")),
                Event::Text(text) => {
                    said.push_str(text);
                    if said.len() > ELEMENT_BYTES_MAX {
                        Err("an element is too large".to_owned())
                    } else {
                        Ok(())
                    }
                }
                Event::End(tag) => scene.end(tag.local_name().as_ref(), said.trim()),
                Event::Eof => break,
                _ => Ok(()),
            };
            if let Err(what) = done {
                return Ok(Err(what));
            }
        }
        Ok(scene.build())
    }

    fn begin(&mut self, tag: &quick_xml::events::BytesStart<'_>) -> std::result::Result<(), String> {
        let field = |wanted: &str| attribute(tag, wanted);
        match tag.local_name().as_ref() {
            "amf" => {
                let unit = field("unit").unwrap_or_else(|| "millimeter".to_owned());
                self.scale = Some(match &unit.to_ascii_lowercase()[..] {
                    "millimeter" => 1.0,
                    "inch" => 25.4,
                    "feet" | "foot" => 304.8,
                    "meter" => 1000.0,
                    "micron" | "micrometer" => 0.001,
                    _ => return Err(format!("{unit} is no unit of length")),
                });
            }
            "object" => {
                self.objects.push(Object { id: field("id").unwrap_or_default(), ..Object::default() })
            }
            "volume" => self.volume = (self.objects.last().map_or(0, |object| object.triangles.len()), false),
            "metadata" => self.metadata = field("type").unwrap_or_default(),
            "instance" => self.instances.push(Instance {
                object: field("objectid").unwrap_or_default(),
                shift: [0.0; 3],
                turns: [0.0; 3],
                factors: [1.0; 3],
            }),
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str, said: &str) -> std::result::Result<(), String> {
        let number = || {
            let number = fast_float2::parse::<f64, _>(said).ok().filter(|n| n.is_finite());
            number.ok_or_else(|| format!("\"{said}\" is not a number"))
        };
        let object = self.objects.last_mut();
        match (name, object) {
            ("x", _) => self.vertex[0] = number()?,
            ("y", _) => self.vertex[1] = number()?,
            ("z", _) => self.vertex[2] = number()?,
            ("coordinates", Some(object)) => object.vertices.push(self.vertex),
            ("v1" | "v2" | "v3", Some(object)) => {
                let found = said.parse().ok().filter(|&n: &u32| (n as usize) < object.vertices.len());
                let corner = usize::from(name.as_bytes()[1] - b'1');
                // Vertices of an object stand before its volumes.
                self.triangle[corner] =
                    found.ok_or_else(|| format!("object {} has no vertex \"{said}\"", object.id))?;
            }
            ("triangle", Some(object)) => object.triangles.push(self.triangle),
            ("metadata", _) => {
                let is_modifier = self.metadata.ends_with("modifier") && said == "1"
                    || self.metadata.ends_with("volume_type") && !["", "ModelPart"].contains(&said);
                self.volume.1 |= is_modifier;
                self.metadata.clear();
            }
            ("volume", Some(object)) if self.volume.1 => {
                object.triangles.truncate(self.volume.0);
                self.modifiers += 1;
            }
            (name, _) => self.place(name, number)?,
        }
        Ok(())
    }

    /// Takes in a number of an instance.
    fn place(
        &mut self,
        name: &str,
        number: impl Fn() -> std::result::Result<f64, String>,
    ) -> std::result::Result<(), String> {
        let Some(instance) = self.instances.last_mut() else { return Ok(()) };
        let axis = match name.as_bytes().last() {
            Some(b'x') => 0,
            Some(b'y') => 1,
            Some(b'z') => 2,
            _ => 3,
        };
        match name {
            "deltax" | "deltay" | "deltaz" => instance.shift[axis] = number()?,
            "rx" | "ry" | "rz" => instance.turns[axis] = number()?,
            "scale" => instance.factors = [number()?; 3],
            "scalex" | "scaley" | "scalez" => instance.factors[axis] *= number()?,
            "mirrorx" | "mirrory" | "mirrorz" if number()? == 1.0 => instance.factors[axis] *= -1.0,
            _ => {}
        }
        Ok(())
    }

    fn build(self) -> std::result::Result<Polygons, String> {
        let Some(scale) = self.scale else { return Err("has no element amf".to_owned()) };
        let scale = Placement::scale([scale; 3]);
        let mut polygons = Polygons::default();
        let room = SceneLimit::of(
            self.objects.iter().map(|object| object.triangles.len() + object.vertices.len()).sum(),
        );
        let mut add = |object: &Object, at: &Placement| {
            let fits = polygons.add_placed(&object.vertices, object.triangles.iter().copied(), at, room);
            fits.then_some(()).ok_or_else(|| "its objects stand in it more often than can be read".to_owned())
        };
        for instance in &self.instances {
            let named = self.objects.iter().find(|object| object.id == instance.object);
            let object = named.ok_or_else(|| format!("there is no object {}", instance.object))?;
            add(object, &scale.after(&instance.placement()))?;
        }
        if self.instances.is_empty() {
            self.objects.iter().try_for_each(|object| add(object, &scale))?;
        }
        if self.modifiers > 0 {
            let what =
                format!("{} volumes are left out: modifiers, or what the slicer subtracts", self.modifiers);
            polygons.warnings.push(what);
        }
        polygons.finish();
        Ok(polygons)
    }
}

impl Instance {
    /// Larger, then turned about x, y and z, then shifted.
    fn placement(&self) -> Placement {
        let turn = |axis: usize| {
            let (sin, cos) = (0.5 * self.turns[axis].to_radians()).sin_cos();
            let mut quaternion = [0.0, 0.0, 0.0, cos];
            quaternion[axis] = sin;
            if sin == 0.0 { Placement::IDENTITY } else { Placement::turn(quaternion) }
        };
        let turned = (0..3).fold(Placement::scale(self.factors), |before, axis| turn(axis).after(&before));
        Placement::shift(self.shift).after(&turned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use std::io::Write;

    const TETRAHEDRON: &str = "<mesh><vertices><vertex><coordinates><x>0</x><y>0</y><z>0</z></coordinates></vertex>\
        <vertex><coordinates><x>1</x><y>0</y><z>0</z></coordinates></vertex><vertex><coordinates><x>0</x><y>1</y><z>0</z>\
        </coordinates></vertex><vertex><coordinates><x>0</x><y>0</y><z> 1 </z></coordinates></vertex></vertices><volume>\
        <triangle><v1>0</v1><v2>2</v2><v3>1</v3></triangle><triangle><v1>0</v1><v2>1</v2><v3>3</v3></triangle>\
        <triangle><v1>1</v1><v2>2</v2><v3>3</v3></triangle><triangle><v1>0</v1><v2>3</v2><v3>2</v3></triangle></volume>\
        <volume><metadata type=\"slic3r.modifier\">1</metadata><triangle><v1>0</v1><v2>1</v2><v3>3</v3></triangle></volume></mesh>";

    fn of(body: &str) -> Result<Polygons> {
        let text = format!(
            "<?xml version=\"1.0\"?>\n<amf unit=\"inch\"><object id=\"7\">{TETRAHEDRON}</object>{body}</amf>"
        );
        let plain = read(Path::new("a.amf"), text.as_bytes(), &Silent);
        let mut zip = zip::write::ZipWriter::new(Cursor::new(Vec::new()));
        zip.start_file("a.amf", zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
        let zipped = read(Path::new("a.amf"), zip.finish().unwrap().get_ref(), &Silent);
        match (&plain, &zipped) {
            (Ok(a), Ok(b)) => assert_eq!((&a.vertices, &a.triangles), (&b.vertices, &b.triangles)),
            (Err(a), Err(b)) => assert_eq!(a.to_string(), b.to_string()),
            other => panic!("{other:?}"),
        }
        plain
    }

    #[test]
    fn objects_stand_where_constellations_place_them() {
        let once = of("").unwrap();
        assert_eq!((once.triangles.len(), once.vertices[1]), (4, [25.4, 0.0, 0.0]));
        assert!(once.warnings[0].contains("1 volumes are left out"), "{:?}", once.warnings);
        let placed = "<constellation id=\"2\"><instance objectid=\"7\"><deltax>2</deltax><rz>90</rz></instance>\
            <instance objectid=\"7\"><mirrorx>1</mirrorx></instance></constellation>";
        let twice = of(placed).unwrap();
        assert_eq!(twice.triangles.len(), 8);
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|n| (a[n] - b[n]).abs() < 1e-12);
        assert!(near(twice.vertices[1], [50.8, 25.4, 0.0]), "{:?}", twice.vertices[1]);
        // Mirrored, and turned over.
        assert!(near(twice.vertices[5], [-25.4, 0.0, 0.0]));
        assert_eq!(twice.triangles[4], [4, 5, 6]);
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (body, what) in [
            ("<constellation><instance objectid=\"8\"/></constellation>", "there is no object 8"),
            (
                "<object><mesh><coordinates><x>a</x></coordinates></mesh></object>",
                "\\\"a\\\" is not a number",
            ),
            (
                "<object><mesh><volume><triangle><v1>9</v1></triangle></volume></mesh></object>",
                "has no vertex",
            ),
            ("<a></b>", "is no well-formed XML"),
        ] {
            let said = of(body).unwrap_err().to_string();
            assert!(said.contains(what) && !said.contains('\n'), "{said}");
        }
        assert!(
            read(Path::new("a.amf"), b"<svg/>", &Silent)
                .unwrap_err()
                .to_string()
                .contains("has no element amf")
        );
    }
}

//! Files that a user may well try and that are no input: what they are, by their beginnings and then by their endings.

use super::text;
use memchr::memmem;
use std::path::Path;

/// Bytes at the end of a ZIP archive that hold its table of contents, of archives with few files.
const ZIP_TABLE_BYTES: usize = 1 << 16;

/// What an AMF file is called in messages.
pub(super) const AMF: &str = "an AMF file";

/// Beginnings, and what they are of.
const BEGINNINGS: [(&[u8], &str); 47] = [
    (b"\x1f\x8b", "compressed with gzip"),
    (b"\xfd7zXZ\0", "compressed with xz"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd"),
    (b"BZh", "compressed with bzip2"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"Rar!", "a RAR archive"),
    (b"ISO-10303-21", "a STEP file, a CAD model"),
    (b"DBRep_DrawableShape", "an OpenCASCADE B-rep, a CAD model"),
    (b"CASCADE Topology", "an OpenCASCADE B-rep, a CAD model"),
    (b"**ABCDEFGHIJKLMNOPQRSTUVWXYZ", "a Parasolid file, a CAD model"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "a compound file of Windows, as SolidWorks and Inventor write"),
    (b"3D Geometry File Format", "a Rhino model"),
    (b"AC10", "a DWG drawing"),
    (b"#X3D", "an X3D file in the ClassicVRML encoding (save it in the XML encoding, .x3d)"),
    (b"#VRML", "a VRML file (save it as X3D in the XML encoding, .x3d)"),
    (b"\xe0\0\0\x01", "an X3D file in the binary encoding (save it in the XML encoding, .x3d)"),
    (b"\xff\xfe", "text in UTF-16 (save it in UTF-8)"),
    (b"\xfe\xff", "text in UTF-16 (save it in UTF-8)"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"BM", "a BMP picture"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"RIFF", "a RIFF file, as WebP and AVI are"),
    (b"%PDF", "a PDF document"),
    (b"\x7fELF", "a program"),
    (b"MZ", "a program of Windows"),
    (b"LASF", "a LAS point cloud"),
    (b"ASTM-E57", "an E57 point cloud"),
    (b"# .PCD", "a PCD point cloud"),
    (b"VERSION .7\nFIELDS", "a PCD point cloud"),
    (b"\x20BDV", "an OpenVDB volume"),
    (b"NanoVDB", "a NanoVDB volume"),
    (b"\x89HDF", "an HDF5 file"),
    (b"\x93NUMPY", "a NumPy array"),
    (b"# vtk DataFile", "a VTK file"),
    (b"Kaydara FBX", "an FBX scene"),
    (b"; FBX", "an FBX scene"),
    (b"BLENDER", "a Blender scene"),
    (b"PXR-USDC", "a USD scene"),
    (b"#usda", "a USD scene"),
    (b"$MeshFormat", "a Gmsh mesh"),
    (b"MeshVersionFormatted", "a Medit mesh"),
    (b"SQLite format 3", "an SQLite database"),
    (b"<!DOCTYPE html", "a web page; was the right link downloaded?"),
    (b"<html", "a web page; was the right link downloaded?"),
];

/// Elements that an XML file's first one tells it by.
const ELEMENTS: [(&[u8], &str); 6] = [
    (b"<COLLADA", "a COLLADA scene"),
    (b"<amf", AMF),
    (b"<VTKFile", "a VTK file"),
    (b"<svg", "an SVG drawing"),
    (b"<model", "the model of a 3MF file, unpacked"),
    (b"<html", "a web page; was the right link downloaded?"),
];

/// Endings of files whose content was not told.
const ENDINGS: [(&str, &str); 18] = [
    ("step", "a STEP file, a CAD model, by its name"),
    ("stp", "a STEP file, a CAD model, by its name"),
    ("iges", "an IGES file, a CAD model, by its name"),
    ("igs", "an IGES file, a CAD model, by its name"),
    ("f3d", "a Fusion design, a CAD model, by its name"),
    ("f3z", "a Fusion design, a CAD model, by its name"),
    ("sldprt", "a SolidWorks part, a CAD model, by its name"),
    ("ipt", "an Inventor part, a CAD model, by its name"),
    ("x_t", "a Parasolid file, a CAD model, by its name"),
    ("x_b", "a Parasolid file, a CAD model, by its name"),
    ("catpart", "a CATIA part, a CAD model, by its name"),
    ("dxf", "a DXF drawing, by its name"),
    ("vtk", "a VTK file, by its name"),
    ("fcstd", "a FreeCAD document, a CAD model, by its name"),
    ("blend", "a Blender scene, by its name"),
    ("gltf", "a glTF file, by its name (export it as .glb)"),
    ("brf", "no brick store, in spite of its name"),
    ("zip", "no ZIP archive, in spite of its name"),
];

/// What a file is, if its content says so, as in "is a PNG picture".
pub(super) fn by_content(path: &Path, bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        return Some(zip(path, bytes));
    }
    let start = text::without_mark(&bytes[..bytes.len().min(1024)]).trim_ascii_start();
    let starts = |magic: &[u8]| {
        let ignores_case = magic.starts_with(b"<");
        bytes.starts_with(magic)
            || start.starts_with(magic)
            || ignores_case && start.get(..magic.len()).is_some_and(|s| s.eq_ignore_ascii_case(magic))
    };
    if let Some((_, what)) = BEGINNINGS.iter().find(|(magic, _)| starts(magic)) {
        return Some(what);
    }
    if start.starts_with(b"<") {
        let named = ELEMENTS.iter().find(|(element, _)| memmem::find(start, element).is_some());
        return named.map(|(_, what)| *what).or_else(|| start.starts_with(b"<?xml").then_some("an XML file"));
    }
    let is_text = |what| start.iter().all(|b| !text::is_control(*b)).then_some(what);
    // Lines of 80 columns, numbered in the last ones.
    if bytes.get(72..80).is_some_and(|end| end.starts_with(b"S") && end[1..].ends_with(b"1")) {
        return is_text("an IGES file, a CAD model");
    }
    if start.starts_with(b"0\nSECTION") || start.starts_with(b"0\r\nSECTION") {
        return Some("a DXF drawing");
    }
    if start.starts_with(b"{") && memmem::find(start, b"\"asset\"").is_some() {
        return Some("a glTF file (export it as .glb)");
    }
    None
}

/// What an archive is, by the names of the files in it, or by its own.
fn zip(path: &Path, bytes: &[u8]) -> &'static str {
    let table = &bytes[bytes.len().saturating_sub(ZIP_TABLE_BYTES)..];
    let holds = |name: &[u8]| memmem::find(table, name).is_some();
    let ends = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    if holds(b"3dmodel.model") || ends("3mf") {
        super::three_mf::WHAT
    } else if ends("amf") || holds(b".amf") {
        AMF
    } else if holds(b"FusionAssetName") || ends("f3d") || ends("f3z") {
        "a Fusion design, a CAD model"
    } else if holds(b"GuiDocument.xml") || ends("fcstd") {
        "a FreeCAD document, a CAD model"
    } else {
        "a ZIP archive"
    }
}

/// What a file is by its ending.
pub(super) fn by_ending(path: &Path) -> Option<&'static str> {
    let ends = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    ENDINGS.iter().find(|(ending, _)| ends(ending)).map(|(_, what)| *what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_by_content_and_then_by_name() {
        let told = |name: &str, bytes: &[u8]| by_content(Path::new(name), bytes);
        assert_eq!(told("a.stl", b"\x89PNG\r\n\x1a\n"), Some("a PNG picture"));
        assert_eq!(told("a", b"ISO-10303-21;\n"), Some("a STEP file, a CAD model"));
        assert_eq!(told("a.f3d", b"PK\x03\x04abc"), Some("a Fusion design, a CAD model"));
        assert_eq!(told("a", b"PK\x03\x04abc 3D/3dmodel.model"), Some(super::super::three_mf::WHAT));
        assert_eq!(told("a", b"<?xml version=\"1.0\"?>\n<COLLADA>"), Some("a COLLADA scene"));
        assert_eq!(told("a", b"  <!doctype HTML>"), Some("a web page; was the right link downloaded?"));
        assert_eq!(told("a", b"  0\nSECTION\n"), Some("a DXF drawing"));
        let iges = [&[b' '; 72][..], b"S      1\n"].concat();
        assert_eq!(told("a", &iges), Some("an IGES file, a CAD model"));
        assert_eq!(told("a.stl", b"solid a\n"), None);
        assert_eq!(by_ending(Path::new("a.STP")), Some("a STEP file, a CAD model, by its name"));
        assert_eq!(by_ending(Path::new("a.stl")), None);
    }
}

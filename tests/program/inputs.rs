//! What people really have: files that programs of all sorts write, told and read for what they are.

use crate::support::*;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

fn report(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/reports").join(name)
}

fn info(path: &Path) -> Value {
    run(&[&"info", &path, &"--json"]).json()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Points of a sphere around the origin, along a spiral: each with its direction, that is, its normal.
fn sphere(count: usize, radius: f64) -> Vec<([f64; 3], [f64; 3])> {
    let point = |n: usize| {
        let z = 1.0 - (2 * n + 1) as f64 / count as f64;
        let (turn, flat) = (n as f64 * 2.399_963_229_728_653, (1.0 - z * z).sqrt());
        let normal = [flat * turn.cos(), flat * turn.sin(), z];
        (normal.map(|c| c * radius), normal)
    };
    (0..count).map(point).collect()
}

/// A text cloud of these columns, of `line` for each point.
fn text(count: usize, line: impl Fn(usize, [f64; 3], [f64; 3]) -> String) -> String {
    sphere(count, 10.0).into_iter().enumerate().map(|(n, (p, normal))| line(n, p, normal) + "\n").collect()
}

/// Volume of the mesh that `build` makes of a cloud.
#[track_caller]
fn volume(dir: &Scratch, input: &Path, more: &[&str]) -> f64 {
    let (store, mesh) = (dir.path("cloud.brf"), dir.path("cloud.ply"));
    let mut args: Vec<&dyn AsRef<OsStr>> =
        vec![&"build", &input, &"-o", &store, &"--mesh", &mesh, &"--quiet"];
    args.extend(more.iter().map(|word| word as &dyn AsRef<OsStr>));
    let ran = run(&args);
    assert_eq!(ran.status, Some(0), "{}", ran.stderr);
    number(&run(&[&"mesh", &"--check", &mesh, &"--json"]).json()["volume"])
}

const SPHERE: f64 = 4188.79;

#[test]
fn colours_are_no_normals() {
    let dir = Scratch::new();
    let out = dir.path("x.brf");
    let given = report("xyz_rgb.xyz");
    let refused = run(&[&"build", &given, &"-o", &out]).failed();
    assert!(
        refused.contains("have no normals (columns 4 to 6 look like colours, whole numbers from 0 to 255)")
            && refused.contains("add --estimate-normals"),
        "{refused}"
    );
    assert!((volume(&dir, &given, &["--estimate-normals"]) / 4181.0 - 1.0).abs() < 0.02);
    let said = info(&given);
    assert_eq!((&said["points"], &said["normals"]), (&400.into(), &Value::Null));
    assert_eq!(said["columns"], serde_json::json!(["x", "y", "z", "red", "green", "blue"]));
    // Others of the kind: intensity and colours after a count (PTS), colours from 0 to 1, colours under their names.
    let bytes = |n: usize| [n * 37 % 256, n * 91 % 256, n * 13 % 256];
    let floats = |n: usize| bytes(n).map(|c| c as f64 / 255.0);
    for (name, content) in [
        (
            "a.pts",
            format!(
                "300\n{}",
                text(300, |n, [x, y, z], _| {
                    let [r, g, b] = bytes(n);
                    format!("{x} {y} {z} {} {r} {g} {b}", n as i64 - 300)
                })
            ),
        ),
        (
            "b.xyz",
            text(300, |n, [x, y, z], _| {
                let [r, g, b] = floats(n);
                format!("{x}\t{y}\t{z}\t{r:.3}\t{g:.3}\t{b:.3}")
            }),
        ),
        (
            "c.csv",
            format!(
                "X;Y;Z;R;G;B\n{}",
                text(300, |n, [x, y, z], _| {
                    let [r, g, b] = bytes(n);
                    format!("{x};{y};{z};{r};{g};{b}")
                })
            ),
        ),
        (
            "d.ply",
            format!(
                "ply\nformat ascii 1.0\nelement vertex 300\nproperty float x\nproperty float y\nproperty float z\nproperty \
             uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n{}",
                text(300, |n, [x, y, z], _| {
                    let [r, g, b] = bytes(n);
                    format!("{x} {y} {z} {r} {g} {b}")
                })
            ),
        ),
    ] {
        let input = dir.file(name, content);
        let refused = run(&[&"build", &input, &"-o", &out]).failed();
        assert!(refused.contains("have no normals (") && refused.contains("--estimate-normals"), "{refused}");
        let volume = volume(&dir, &input, &["--estimate-normals"]);
        assert!((volume / SPHERE - 1.0).abs() < 0.06, "{name}: {volume}");
        let said = run(&[&"info", &input]).ok();
        assert!(
            said.contains("red green blue") && said.contains("refuses it without --estimate-normals"),
            "{said}"
        );
    }
}

#[test]
fn normals_are_found_wherever_they_stand() {
    let dir = Scratch::new();
    for (name, content) in [
        ("a.xyz", text(300, |_, [x, y, z], [nx, ny, nz]| format!("{x} {y} {z} {nx:.3} {ny:.3} {nz:.3}"))),
        (
            "b.asc",
            text(300, |n, [x, y, z], [nx, ny, nz]| {
                format!("{x},{y},{z},{},7,200,{nx:.3},{ny:.3},{nz:.3}", n % 256)
            }),
        ),
        (
            "c.xyz",
            format!(
                "//X Y Z Nx Ny Nz R G B\n300\n{}",
                text(300, |n, [x, y, z], [nx, ny, nz]| {
                    format!("{x} {y} {z} {} {} {} 1 2 {}", 3.0 * nx, 3.0 * ny, 3.0 * nz, n % 256)
                })
            ),
        ),
        (
            "d.txt",
            format!(
                "nz ny nx z y x\n{}",
                text(300, |_, [x, y, z], [nx, ny, nz]| { format!("{nz:.3} {ny:.3} {nx:.3} {z} {y} {x}") })
            ),
        ),
        (
            "e.xyz",
            text(300, |_, p, n| {
                p.iter().chain(&n).map(|c| format!("{c:.4}")).collect::<Vec<_>>().join(" ").replace('.', ",")
            }),
        ),
    ] {
        let input = dir.file(name, content);
        let volume = volume(&dir, &input, &[]);
        assert!((volume / SPHERE - 1.0).abs() < 0.06, "{name}: {volume}");
        let said = info(&input);
        assert_eq!((&said["points"], &said["normals"]["count"]), (&300.into(), &300.into()), "{name}");
        assert!(number(&said["build"]["cell"]) > 0.1 && number(&said["neighbour_distance"]) > 0.1, "{said}");
    }
    // A normal that is missing is told, and one that is none stops nothing.
    let zeros = text(300, |n, [x, y, z], [nx, ny, nz]| match n % 20 {
        0 => format!("{x} {y} {z} 0 0 0"),
        _ => format!("{x} {y} {z} {nx} {ny} {nz}"),
    });
    let input = dir.file("zeros.xyz", zeros);
    let ran = run(&[&"build", &input, &"-o", &dir.path("z.brf")]);
    assert!(ran.status == Some(0) && ran.stderr.contains("15 of 300 normals are 0"), "{}", ran.stderr);
    assert!(ran.stdout.contains("normals given, lengths 1 to 1, 15 are 0"), "{}", ran.stdout);
}

#[test]
fn decimal_commas_are_read_or_named() {
    let dir = Scratch::new();
    let said = info(&report("xyz_decimal_comma.xyz"));
    assert_eq!(
        (&said["points"], &said["bounds"]),
        (&8.into(), &serde_json::json!([[0.0, 0.0, 0.0], [1.5, 1.5, 1.5]]))
    );
    assert_eq!((&said["decimal_commas"], &said["warnings"]), (&true.into(), &serde_json::json!([])));
    for (name, content) in
        [("a.xyz", "0,5;1,5;2\n1,5;2,5;-3,5\n"), ("b.xyz", "0,5\t1,5\t2\n1,5\t2,5\t-3,5\n")]
    {
        let bounds = serde_json::json!([[0.5, 1.5, -3.5], [1.5, 2.5, 2.0]]);
        assert_eq!(info(&dir.file(name, content))["bounds"], bounds, "{name}");
    }
    let stl = "solid a\nfacet normal 0,0 0,0 1,0\nouter loop\nvertex 0,0 0,0 0,0\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement \
               face 1\nproperty list uchar int vertex_indices\nend_header\n0,5 0,5 1,5\n";
    for (name, content) in
        [("c.stl", stl), ("d.ply", ply), ("e.obj", "v 0,5 1,5 2,5\n"), ("f.xyz", "1.5 2 3\n1,5 2 3\n")]
    {
        let line = run(&[&"info", &dir.file(name, content)]).failed();
        assert!(line.contains(name) && line.contains("decimal commas?"), "{line}");
    }
    // Points to ask for.
    let model = stl_of_a_box(&dir);
    for points in [
        "0,5;0,5;0,5\n2;2;2\n",
        "x;y;z\n0,5;0,5;0,5\n2,0;2,0;2,0\n",
        "0.5 0.5 0.5\n2 2 2\n",
        "0,5\t0,5\t0,5\n2\t2\t2\n",
    ] {
        let said = run_with(&[&"winding", &model, &"--points", &"-"], points).ok();
        assert_eq!(said, "x,y,z,w\n0.5,0.5,0.5,1\n2.0,2.0,2.0,0\n", "{points}");
    }
    let ran = run_with(&[&"winding", &model, &"--points", &"-"], "0,5,0,5,0,5\n");
    assert!(ran.status == Some(1) && ran.stderr.contains("decimal commas?"), "{}", ran.stderr);
}

fn stl_of_a_box(dir: &Scratch) -> PathBuf {
    dir.file("box.stl", binary_stl(12, &cuboid([0.0; 3], [1.0; 3])))
}

#[test]
fn texts_with_stray_bytes_are_texts() {
    let dir = Scratch::new();
    let tail = report("st_nul_tail.stl");
    assert_eq!((&info(&tail)["facets"], &info(&tail)["format"]), (&4.into(), &"STL ASCII".into()));
    let whole = std::fs::read_to_string(&tail).unwrap();
    let whole = whole.trim_end_matches('\0');
    for (name, content) in [
        ("a.stl", whole.replacen("\nfacet", "\n\x01 facet", 2) + "\x1a"),
        ("b.stl", whole.replace('\n', "\x0c\n").to_uppercase()),
        ("c.stl", whole.replacen("solid t", "solid \x02\u{e9}\x7f t", 1)),
        (
            "d.stl",
            whole
                .replacen("normal 0 0 -1", "normal nan nan nan", 1)
                .replace("endsolid t\n", "endsolid t\n\0\0\0"),
        ),
    ] {
        let said = info(&dir.file(name, content));
        assert_eq!(
            (&said["facets"], &said["format"], &said["closed"]),
            (&4.into(), &"STL ASCII".into(), &true.into())
        );
    }
    // What is really damaged is named by its line.
    let line =
        run(&[&"info", &dir.file("e.stl", whole.replacen("vertex 0 0 0", "vertex 0\x000 0 0", 1))]).failed();
    assert!(line.contains("line 4") && line.contains("control byte"), "{line}");
    let unended = run(&[&"info", &dir.file("f.stl", whole.replace("endsolid t\n", ""))]);
    assert!(
        unended.status == Some(0) && unended.stderr.contains("ends without \"endsolid\""),
        "{}",
        unended.stderr
    );
}

#[test]
fn harmless_liberties_are_taken() {
    let dir = Scratch::new();
    assert_eq!(info(&report("ply_space.ply"))["facets"], 1);
    let good = std::fs::read_to_string(report("ply_space.ply")).unwrap();
    for (name, content) in [
        ("a.ply", good.replace('\n', "\r\n")),
        ("b.ply", good.replace('\n', "\r")),
        (
            "c.ply",
            format!(
                "\u{feff}\n\n{}",
                good.replacen("ply ", "PLY\t", 1).replace("format ascii", "format\tascii ")
            ),
        ),
        (
            "d.ply",
            good.replace(
                "element face",
                "obj_info x\ncomment y\nelement edge 0\nproperty int a\nelement face",
            ),
        ),
    ] {
        assert_eq!(info(&dir.file(name, content))["facets"], 1, "{name}");
    }
    let obj = "\u{feff}v\t0 0 0 1\nv 1 0 0 .5 .5 .5\nv 0 1 0\nusemtl a\nf -3//1 \\\n -2//1 -1//1";
    assert_eq!(info(&dir.file("a.obj", obj))["facets"], 1);
    // The binary form of a PLY with carriage returns and a blank behind its magic word.
    let mut bytes = b"ply \r\nformat binary_little_endian 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\n\
                      property float z\r\nelement face 1\r\nproperty list uchar ushort vertex_index\r\nend_header\r\n"
        .to_vec();
    [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    bytes.extend([3, 0, 0, 1, 0, 2, 0]);
    assert_eq!(info(&dir.file("binary.ply", bytes))["facets"], 1);
}

/// A prism over a polygon, as an OBJ or a PLY of two large faces and a side for each edge.
fn prism(polygon: &[[f64; 2]], slant: f64, ply: bool) -> String {
    let count = polygon.len();
    let mut vertices = String::new();
    for z in [0.0, 1.0] {
        for [x, y] in polygon {
            vertices += &format!("{}{x} {y} {}\n", if ply { "" } else { "v " }, z + slant * x * y);
        }
    }
    let mut faces = vec![(0..count).rev().collect::<Vec<_>>(), (count..2 * count).collect()];
    faces.extend((0..count).map(|i| vec![i, (i + 1) % count, count + (i + 1) % count, count + i]));
    let face = |face: &Vec<usize>| {
        let corners: Vec<String> = face.iter().map(|v| (v + usize::from(!ply)).to_string()).collect();
        let head = if ply { face.len().to_string() } else { "f".to_owned() };
        format!("{head} {}\n", corners.join(" "))
    };
    let faces: String = faces.iter().map(face).collect();
    match ply {
        false => vertices + &faces,
        true => format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face \
             {}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
            2 * count,
            count + 2
        ),
    }
}

#[test]
fn concave_polygons_are_covered_once() {
    let dir = Scratch::new();
    let checked = |path: &Path| run(&[&"mesh", &"--check", &path, &"--json"]).json();
    let said = checked(&report("concave_ngon.obj"));
    assert_eq!((&said["sound"], &said["area"], &said["volume"]), (&true.into(), &14.0.into(), &3.0.into()));
    let c = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [3.0, 2.0], [3.0, 3.0], [0.0, 3.0]];
    let star: Vec<[f64; 2]> = (0..10)
        .map(|i| {
            let (turn, far) = (f64::from(i) * std::f64::consts::PI / 5.0, [4.0, 1.0][i as usize % 2]);
            [far * turn.cos(), far * turn.sin()]
        })
        .collect();
    let midpoints = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 0.5], [0.0, 1.0]];
    for (name, polygon, slant, volume) in [
        ("c", &c[..], 0.0, Some(7.0)),
        ("star", &star[..], 0.0, None),
        ("midpoints", &midpoints[..], 0.0, Some(1.5)),
        ("warped", &c[..], 0.01, None),
    ] {
        for ply in [false, true] {
            let path =
                dir.file(&format!("{name}.{}", if ply { "ply" } else { "obj" }), prism(polygon, slant, ply));
            let said = checked(&path);
            assert_eq!((&said["sound"], &said["genus"]), (&true.into(), &0.into()), "{name}: {said}");
            assert!(
                volume.is_none_or(|volume| (number(&said["volume"]) - volume).abs() < 1e-9),
                "{name}: {said}"
            );
        }
    }
}

#[test]
fn info_says_what_is_in_every_input() {
    let dir = Scratch::new();
    let said = info(&stl("overlap_boxes"));
    assert_eq!((&said["closed"], &said["skipped_faces"]), (&true.into(), &0.into()));
    assert!((number(&said["volume"]) - truth("overlap_boxes", "sum_volume")).abs() < 1e-6, "{said}");
    assert!(number(&said["area"]) > 0.0);
    assert_eq!(info(&stl("open_box_no_lid"))["volume"], Value::Null);
    let text = run(&[&"info", &stl("spot40_model")]).ok();
    assert!(text.contains("STL binary") && text.contains("area ") && text.contains("volume "), "{text}");

    let x3d = "<X3D><Scene><Shape><Extrusion DEF='rod'/></Shape>\n<Shape><Extrusion DEF='pipe' beginCap='false' \
               spine='0 5 0, 0 6 0, 0 7 0'/></Shape></Scene></X3D>";
    let x3d = dir.file("two.x3d", x3d);
    let said = info(&x3d);
    let [rod, pipe] = [0, 1].map(|n| said["shapes"][n].clone());
    assert_eq!(
        (&rod["def"], &rod["facets"], &rod["closed"], &rod["line"]),
        (&"rod".into(), &12.into(), &true.into(), &1.into())
    );
    assert_eq!(
        (&pipe["def"], &pipe["closed"], &pipe["line"], &said["closed"]),
        (&"pipe".into(), &false.into(), &2.into(), &false.into())
    );
    assert_eq!(
        (&rod["volume"], &rod["bounds"]),
        (&4.0.into(), &serde_json::json!([[-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]]))
    );
    assert!(run(&[&"info", &x3d]).ok().contains("line 2: pipe: "));

    let said = info(&report("tip.3mf"));
    assert_eq!(
        (&said["format"], &said["unit"], &said["triangles"]),
        (&"3MF".into(), &"millimeter".into(), &4.into())
    );
    assert_eq!((&said["objects"][0]["name"], &said["objects"][1]["components"]), (&"tip".into(), &2.into()));
    assert_eq!((&said["items"][0]["object"], &said["read_by_build"]), (&"2".into(), &true.into()));
    // What this program writes itself.
    let store = dir.store("overlap_boxes", 1);
    let written = dir.path("union.3mf");
    let mesh = run(&[&"mesh", &store, &"-o", &written, &"--json"]).json();
    assert_eq!(info(&written)["triangles"], mesh["triangles"]);
}

/// A mesh that goes out in a format and comes in again has the same bytes as STL.
#[test]
fn meshes_come_back_from_the_formats_that_are_written() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let first = dir.path("first.ply");
    run(&[&"mesh", &store, &"-o", &first]).ok();
    let volume = |mesh: &Path| {
        let out = dir.path("again.brf");
        let built = run(&[&"build", &mesh, &"-o", &out, &"--depth", &"2", &"--json"]).json();
        std::fs::remove_file(&out).unwrap();
        (built["facets"].clone(), built["volumes"]["union"].as_f64().unwrap())
    };
    let (facets, expected) = volume(&first);
    for ending in ["3mf", "glb", "obj", "stl"] {
        let mesh = dir.path(&format!("m.{ending}"));
        run(&[&"mesh", &store, &"-o", &mesh]).ok();
        let (again, found) = volume(&mesh);
        assert_eq!(again, facets, "{ending}");
        assert!((found - expected).abs() < 1e-3, "{ending}: {found} for {expected}");
        run(&[&"mesh", &"--check", &mesh, &"--quiet"]).ok();
    }
    // As others write it: an OFF of the same positions.
    let text = std::fs::read(&first).unwrap();
    assert!(text.starts_with(b"ply"));
    let off = dir.file(
        "tetrahedron.off",
        "OFF\n4 4 0\n0 0 0\n6 0 0\n0 6 0\n0 0 6\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n",
    );
    assert!((volume(&off).1 - 36.0).abs() < 1e-4);
}

/// What is typed, and what the answer holds.
type Case<'a> = (&'a [&'a dyn AsRef<OsStr>], &'a [&'a str]);

#[test]
fn the_wrong_kind_of_file_is_told_with_the_command_that_wants_it() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let mesh = stl_of_a_box(&dir);
    let gcode = dir.file("part.gcode", "G1 X1\n");
    let cloud = dir.file("a b.xyz", "1 2 3\n4 5 6\n");
    let (png, step) = (dir.file("x.png", b"\x89PNG\r\n\x1a\n"), dir.file("x.step", "ISO-10303-21;\n"));
    let fusion = dir.file("x.f3d", b"PK\x03\x04\0\0");
    let points = dir.file("p.csv", "0,0,0\n");
    let out = dir.path("o.png");
    let cases: [Case<'_>; 16] = [
        (
            &[&"mesh", &mesh, &"-o", &"x.stl"],
            &[
                "is a mesh (STL), not a brick store",
                "`brickfield build ",
                "box.brf`",
                "`brickfield mesh --check ",
            ],
        ),
        (
            &[&"sample", &gcode, &"--points", &points],
            &["is a toolpath (G-code), not a brick store", "`brickfield build "],
        ),
        (&[&"render", &mesh, &"-o", &out], &["is a mesh (STL)", "`brickfield build "]),
        (&[&"slice", &cloud, &"--z", &"1", &"-o", &out], &["is a point cloud (XYZ)", "/a b.xyz' -o '"]),
        (&[&"cache", &"ls", &report("ply_space.ply")], &["is a mesh (PLY)", "`brickfield build "]),
        (&[&"cache", &"merge", &mesh, &"-o", &"x.brf"], &["is a mesh (STL)"]),
        (&[&"verify", &png], &["is a PNG picture, not a brick store"]),
        (
            &[&"export", &report("tip.3mf"), &"--level", &"0", &"-o", &"w.npy"],
            &["is a 3MF file, not a brick store", "`brickfield build "],
        ),
        (&[&"info", &png], &["is a PNG picture, which is not read; give a mesh"]),
        (&[&"info", &step], &["is a STEP file, a CAD model", "export the part as a mesh"]),
        (&[&"info", &fusion], &["is a Fusion design"]),
        (&[&"build", &store, &"-o", &"x.brf"], &["is a brick store", "`brickfield info "]),
        (&[&"build", &step, &"-o", &"x.brf"], &["is a STEP file", "export the part as a mesh"]),
        (
            &[&"winding", &store, &"--points", &points],
            &["is a brick store", "`brickfield sample ", "--points"],
        ),
        (&[&"beads", &mesh, &"-o", &"x.stl"], &["is a mesh (STL), not a toolpath", "`brickfield build "]),
        (&[&"beads", &store, &"-o", &"x.stl"], &["is a brick store, not a toolpath"]),
    ];
    let before = dir.names();
    for (args, told) in cases {
        let line = run(args).failed();
        assert!(told.iter().all(|what| line.contains(what)), "{line}");
    }
    let misused = run(&[&"mesh", &"--check", &store]).misused();
    assert!(misused.contains("is a brick store; --check takes a mesh"), "{misused}");
    // What a file is does not hang on its name.
    let renamed = dir.path("renamed.dat");
    std::fs::copy(&mesh, &renamed).unwrap();
    run(&[&"mesh", &"--check", &renamed, &"--quiet"]).ok();
    std::fs::remove_file(&renamed).unwrap();
    assert_eq!(dir.names(), before);
}

#[test]
fn defaults_are_right() {
    let dir = Scratch::new();
    let (open, closed) = (dir.store("open_box_no_lid", 1), dir.store("overlap_boxes", 1));
    for (store, more, dtype) in [
        (&open, None, "<f4"),
        (&open, Some("i2"), "<i2"),
        (&closed, None, "<i2"),
        (&closed, Some("f4"), "<f4"),
    ] {
        let array = dir.path("w.npy");
        let mut args: Vec<&dyn AsRef<OsStr>> =
            vec![&"export", store, &"--level", &"1", &"-o", &array, &"--json"];
        if let Some(more) = &more {
            args.extend([&"--dtype" as &dyn AsRef<OsStr>, more]);
        }
        assert_eq!(run(&args).json()["dtype"], dtype);
        let fractions = Array::read(&array);
        let w = fractions.at([32, 32, 32]);
        assert!(dtype == "<i2" || store == &closed || w.fract() != 0.0, "{w}");
    }
    let out = dir.path("s.png");
    let drawn = |more: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"slice", &closed, &"-o", &out, &"--z", &"5", &"--json"];
        args.extend(more.iter().map(|word| word as &dyn AsRef<OsStr>));
        let size = run(&args).json()["size"].clone();
        number(&size[0]).max(number(&size[1]))
    };
    let (by_default, samples) = (drawn(&[]), drawn(&["--samples"]));
    assert!((1000.0..1100.0).contains(&by_default), "{by_default}");
    assert!(samples < 100.0 && drawn(&["--size", "64"]) == 64.0, "{samples}");
    let iso = run(&[&"mesh", &closed, &"-o", &dir.path("x.stl"), &"--iso", &"-0.5"]).misused();
    assert!(iso.contains("--iso -0.5: surfaces are where w rises above a number greater than 0"), "{iso}");
    run(&[&"slice", &closed, &"--z", &"-1", &"-o", &out]).failed();
    run(&[&"cache", &"ls", &closed, &"--box", &"-1,-1,-1,2,2,2"]).ok();
    run(&[
        &"render", &closed, &"-o", &out, &"--size", &"16x16", &"--cut", &"z<-1", &"--view", &"-30,20", &"-q",
    ])
    .ok();
}

#[test]
fn a_folder_of_files_is_run_through() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("SKIPPED: there is no python3 here, so bench-data/corpus.py was not run");
        return;
    }
    let dir = Scratch::new();
    let corpus = dir.path("corpus");
    std::fs::create_dir(&corpus).unwrap();
    for name in ["xyz_rgb.xyz", "concave_ngon.obj", "tip.3mf"] {
        std::fs::copy(report(name), corpus.join(name)).unwrap();
    }
    std::fs::copy(stl("overlap_boxes"), corpus.join("boxes.stl")).unwrap();
    std::fs::write(corpus.join("notes.txt"), "Dear diary,\n").unwrap();
    let (csv, json) = (dir.path("t.csv"), dir.path("t.json"));
    let mut command = Command::new("python3");
    command.arg(example("corpus.py")).arg(&corpus).arg("--program").arg(env!("CARGO_BIN_EXE_brickfield"));
    command.args(["--check", "--depth", "1"]).arg("--csv").arg(&csv).arg("--json").arg(&json);
    let ran: Run = command.output().expect("it runs").into();
    assert_eq!(ran.status, Some(0), "{}{}", ran.stdout, ran.stderr);
    let table: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let rows = table["rows"].as_array().unwrap();
    let result = |file: &str, command: &str| {
        let of = |row: &&Value| row["file"].as_str().unwrap().ends_with(file) && row["command"] == command;
        let row = rows.iter().find(of).unwrap_or_else(|| panic!("{file} {command}"));
        (row["kind"].as_str().unwrap().to_owned(), row["result"].as_str().unwrap().to_owned())
    };
    let told = |kind: &str, result: &str| (kind.to_owned(), result.to_owned());
    assert_eq!(result("xyz_rgb.xyz", "info"), told("XYZ points", "ok"));
    assert_eq!(result("xyz_rgb.xyz", "build"), told("XYZ points", "refused"));
    assert_eq!(result("concave_ngon.obj", "check"), told("OBJ", "ok"));
    assert_eq!(result("boxes.stl", "build"), told("STL binary", "ok"));
    assert_eq!(result("boxes.stl", "check"), told("STL binary", "refused"));
    assert_eq!(result("notes.txt", "info"), told("?", "refused"));
    assert_eq!(result("tip.3mf", "build"), told("3MF", "ok"));
    assert_eq!(std::fs::read_to_string(&csv).unwrap().lines().count(), rows.len() + 1);
    // A limit that is too small is told as such.
    let mut command = Command::new("python3");
    command.arg(example("corpus.py")).arg(corpus.join("boxes.stl")).args(["--no-build", "--seconds", "1e-9"]);
    let ran: Run =
        command.arg("--program").arg(env!("CARGO_BIN_EXE_brickfield")).output().expect("it runs").into();
    assert!(ran.status == Some(1) && ran.stdout.contains("TIMEOUT"), "{}{}", ran.stdout, ran.stderr);
}

//! `splats` and `render --splats`, as their users run them.

use crate::support::*;
use std::path::PathBuf;

/// A store of two boxes that overlap.
fn boxes(dir: &Scratch) -> PathBuf {
    let mut facets = cuboid([0.0; 3], [10.0, 8.0, 6.0]);
    facets.extend(cuboid([6.0, 2.0, 3.0], [14.0, 6.0, 9.0]));
    let input = dir.file("boxes.stl", binary_stl(24, &facets));
    let store = dir.path("boxes.brf");
    run(&[&"build", &input, &"-o", &store, &"--depth", &"2"]).ok();
    store
}

#[test]
fn splats_are_written_for_other_programs() {
    let dir = Scratch::new();
    let store = boxes(&dir);
    let out = dir.path("boxes.ply");
    run(&[&"splats", &store, &"-o", &out]).ok();
    let bytes = std::fs::read(&out).unwrap();
    let end = bytes.windows(11).position(|text| text == b"end_header\n").unwrap() + 11;
    let head = std::str::from_utf8(&bytes[..end]).unwrap();
    let names: Vec<&str> = head.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
    let expected = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    assert_eq!(names.join(" "), expected);
    let count = head.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap();
    let count: usize = count.parse().unwrap();
    assert_eq!(bytes.len() - end, count * 56);
    // All of them lie on a face of a box, and are thin across it.
    let number = |splat: usize, n: usize| {
        let at = end + splat * 56 + n * 4;
        f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()))
    };
    let faces = [[0.0, 10.0, 6.0, 14.0], [0.0, 8.0, 2.0, 6.0], [0.0, 6.0, 3.0, 9.0]];
    for splat in 0..count {
        let off = (0..3).flat_map(|axis| faces[axis].map(|face| (number(splat, axis) - face).abs()));
        assert!(off.fold(f64::MAX, f64::min) < 0.02);
        assert!(number(splat, 9) < number(splat, 7) - 2.0, "scales are logarithms");
        let turn = (10..14).map(|n| number(splat, n).powi(2)).sum::<f64>();
        assert!((turn - 1.0).abs() < 1e-5);
    }
}

/// Reads a GLB file as its specification says, with what is in its attributes.
fn read_glb(bytes: &[u8]) -> (serde_json::Value, impl Fn(&str, usize) -> Vec<f64>) {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
    assert_eq!(&bytes[16..20], b"JSON");
    let end = 20 + word(12);
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..end]).unwrap();
    assert_eq!((&bytes[end + 4..end + 8], end % 4), (&b"BIN\0"[..], 0));
    let data = bytes[end + 8..].to_vec();
    assert_eq!((word(end), json["buffers"][0]["byteLength"].as_u64()), (data.len(), Some(data.len() as u64)));
    let primitive = json["meshes"][0]["primitives"][0].clone();
    let (accessors, views) = (json["accessors"].clone(), json["bufferViews"].clone());
    let values = move |name: &str, point: usize| {
        let accessor = &accessors[primitive["attributes"][name].as_u64().unwrap() as usize];
        let view = &views[accessor["bufferView"].as_u64().unwrap() as usize];
        let places = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let at = accessor["byteOffset"].as_u64().unwrap() as usize;
        let at = at + point * view["byteStride"].as_u64().unwrap() as usize;
        match accessor["componentType"].as_u64().unwrap() {
            5126 => data[at..at + 4 * places]
                .as_chunks()
                .0
                .iter()
                .map(|c| f32::from_le_bytes(*c).into())
                .collect(),
            5121 => data[at..at + places].iter().map(|c| f64::from(*c) / 255.0).collect(),
            other => panic!("component {other}"),
        }
    };
    (json, values)
}

#[test]
fn splats_in_gltf_are_those_of_the_other_file() {
    let dir = Scratch::new();
    let store = boxes(&dir);
    let [glb, again, ply] = ["boxes.glb", "again.glb", "boxes.ply"].map(|name| dir.path(name));
    let told = run(&[&"splats", &store, &"-o", &glb, &"--json", &"--threads", &"1"]).json();
    run(&[&"splats", &store, &"-o", &again, &"--quiet", &"--threads", &"3"]).ok();
    run(&[&"splats", &store, &"-o", &ply, &"--quiet"]).ok();
    let [glb, again, ply] = [glb, again, ply].map(|path| std::fs::read(path).unwrap());
    assert!(glb == again);
    let (json, values) = read_glb(&glb);
    assert_eq!(json["extensionsUsed"], serde_json::json!(["KHR_gaussian_splatting"]));
    let primitive = &json["meshes"][0]["primitives"][0];
    assert_eq!(primitive["mode"], 0);
    let extension = &primitive["extensions"]["KHR_gaussian_splatting"];
    assert_eq!(
        (&extension["kernel"], &extension["colorSpace"]),
        (&"ellipse".into(), &"srgb_rec709_display".into())
    );
    let count = json["accessors"][0]["count"].as_u64().unwrap() as usize;
    assert_eq!(told["splats"], count);
    let matrix: Vec<f64> =
        json["nodes"][0]["matrix"].as_array().unwrap().iter().map(|c| c.as_f64().unwrap()).collect();
    // Millimetres to metres, z to y.
    assert_eq!(
        matrix,
        [0.001, 0.0, 0.0, 0.0, 0.0, 0.0, -0.001, 0.0, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    );
    let body = ply.windows(11).position(|text| text == b"end_header\n").unwrap() + 11;
    assert_eq!((ply.len() - body) / 56, count);
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for splat in 0..count {
        let number = |n: usize| {
            let at = body + splat * 56 + n * 4;
            f64::from(f32::from_le_bytes(ply[at..at + 4].try_into().unwrap()))
        };
        let position = values("POSITION", splat);
        assert_eq!(position, [0, 1, 2].map(number));
        for a in 0..3 {
            (low[a], high[a]) = (low[a].min(position[a]), high[a].max(position[a]));
        }
        assert_eq!(values("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", splat), [3, 4, 5].map(number));
        assert_eq!(values("KHR_gaussian_splatting:ROTATION", splat), [11, 12, 13, 10].map(number));
        let scale = values("KHR_gaussian_splatting:SCALE", splat);
        assert!((0..3).all(|a| (scale[a].ln() - number(7 + a)).abs() < 1e-5));
        let [opacity] = values("KHR_gaussian_splatting:OPACITY", splat)[..] else { panic!("one number") };
        assert!((opacity - 1.0 / (1.0 + (-number(6)).exp())).abs() < 1e-5);
        // Points are as bright as the Gaussians: those have the curve of screens, these have light.
        let grey = (number(3) * 0.282_094_791_8 + 0.5).clamp(0.0, 1.0);
        let light = if grey <= 0.04045 { grey / 12.92 } else { ((grey + 0.055) / 1.055).powf(2.4) };
        let colour = values("COLOR_0", splat);
        assert!(colour[..3].iter().all(|c| (c - light).abs() < 0.003) && (colour[3] - 0.99).abs() < 0.003);
    }
    let stated = |name: &str| -> Vec<f64> {
        json["accessors"][0][name].as_array().unwrap().iter().map(|c| c.as_f64().unwrap()).collect()
    };
    assert_eq!((stated("min"), stated("max")), (low.to_vec(), high.to_vec()));
}

#[test]
fn files_of_splats_are_the_same_for_any_number_of_threads_and_draw_the_part() {
    let dir = Scratch::new();
    let store = boxes(&dir);
    let made = |threads: &str| {
        let out = dir.path(&format!("{threads}.bsp"));
        run(&[&"splats", &store, &"-o", &out, &"--threads", &threads]).ok();
        std::fs::read(out).unwrap()
    };
    assert!(made("1") == made("3"));
    let [file, of_store] = ["file.png", "store.png"].map(|name| dir.path(name));
    let bsp = dir.path("1.bsp");
    let draw = ["--splats", "--size", "160x120", "--lod", "0"];
    for (what, out) in [(&bsp, &file), (&store, &of_store)] {
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"render", what, &"-o", out];
        args.extend(draw.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
        run(&args).ok();
    }
    // Rays through the store meet the part where splats are drawn.
    let rays = dir.path("rays.png");
    run(&[&"render", &store, &"-o", &rays, &"--size", &"160x120", &"--lod", &"0"]).ok();
    let seen = |path: &PathBuf| {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (160, 120, png::ColorType::Rgb));
        bytes.chunks_exact(3).map(|pixel| pixel != [255; 3]).collect::<Vec<bool>>()
    };
    let (rays, file, of_store) = (seen(&rays), seen(&file), seen(&of_store));
    let apart = |a: &[bool], b: &[bool]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    assert!(rays.iter().filter(|seen| **seen).count() > 3000);
    assert!(apart(&rays, &file) < 250 && apart(&file, &of_store) < 60, "{}", apart(&rays, &file));
}

#[test]
fn a_page_has_all_that_it_needs() {
    let dir = Scratch::new();
    let store = boxes(&dir);
    let (page, bsp) = (dir.path("boxes.html"), dir.path("boxes.bsp"));
    run(&[&"splats", &store, &"-o", &page]).ok();
    run(&[&"splats", &store, &"-o", &bsp]).ok();
    let text = std::fs::read_to_string(&page).unwrap();
    let bytes = std::fs::metadata(&bsp).unwrap().len() as usize;
    assert!(text.len() < bytes * 4 / 3 + 180_000, "{} and {bytes}", text.len());
    for asks in ["http:", "https:", "src=", "@import", "@DATA@", "@DECODER@"] {
        assert!(!text.contains(asks), "{asks}");
    }
}

#[test]
fn a_folder_for_servers_has_a_page_and_the_same_splats() {
    let dir = Scratch::new();
    let store = boxes(&dir);
    let bsp = dir.path("boxes.bsp");
    run(&[&"splats", &store, &"-o", &bsp]).ok();
    let folder = dir.path("viewer");
    let named = format!("{}/", folder.display());
    let told = run(&[&"splats", &store, &"-o", &named, &"--json"]).json();
    assert_eq!(std::fs::read(folder.join("part.bsp")).unwrap(), std::fs::read(&bsp).unwrap());
    let page = std::fs::read_to_string(folder.join("index.html")).unwrap();
    assert_eq!(told["bytes"].as_u64().unwrap(), page.len() as u64 + std::fs::metadata(&bsp).unwrap().len());
    // It may ask its own server, and no other.
    assert!(page.contains("default-src 'none'") && page.contains("connect-src 'self'\">"));
    for asks in
        ["http:", "https:", "src=", "@import", "@CONNECT@", "@WORKER@", "@SHADERS@", "@VIEWER@", "@DATA@"]
    {
        assert!(!page.contains(asks), "{asks}");
    }
    // Other files in the folder stay, and a folder that is there needs no sign at its end.
    std::fs::write(folder.join("other.txt"), "mine").unwrap();
    std::fs::write(folder.join("part.bsp"), "old").unwrap();
    run(&[&"splats", &store, &"-o", &folder]).ok();
    assert_eq!(std::fs::read(folder.join("part.bsp")).unwrap(), std::fs::read(&bsp).unwrap());
    assert_eq!(std::fs::read_to_string(folder.join("other.txt")).unwrap(), "mine");
    // What is not there is not made with all that is above it.
    let deep = format!("{}/a/b/", dir.path("none").display());
    assert!(run(&[&"splats", &store, &"-o", &deep]).failed().contains("make the folder"));
}

#[test]
fn wrong_usage_and_damage_are_told_in_a_line() {
    let dir = Scratch::new();
    let store = boxes(&dir);
    assert!(
        run(&[&"splats", &store, &"-o", &dir.path("a.xyz")])
            .misused()
            .contains("ends in one of .bsp, .html, .ply, .glb")
    );
    assert!(
        run(&[&"splats", &store, &"-o", &dir.path("a.bsp"), &"--level", &"7"])
            .failed()
            .contains("there is no level 7")
    );
    assert!(
        run(&[&"splats", &dir.file("a.stl", b"solid a\nendsolid a\n"), &"-o", &dir.path("a.bsp")])
            .failed()
            .contains("a.stl")
    );
    let bsp = dir.path("a.bsp");
    run(&[&"splats", &store, &"-o", &bsp]).ok();
    let told = run(&[&"sample", &bsp, &"--points", &"-"]).failed();
    assert!(told.contains("is a file of splats") && told.contains("render"), "{told}");
    let mut bytes = std::fs::read(&bsp).unwrap();
    let last = bytes.len() - 5;
    bytes[last] ^= 4;
    let damaged = dir.file("damaged.bsp", bytes);
    assert!(
        run(&[&"render", &damaged, &"--splats", &"-o", &dir.path("a.png"), &"--lod", &"0"])
            .failed()
            .contains("a unit is damaged")
    );
    assert!(
        run(&[&"render", &bsp, &"--splats", &"-o", &dir.path("a.apng")])
            .misused()
            .contains("must end in .png")
    );
    assert!(!dir.path("a.png").exists());
}

#[test]
fn a_tolerance_makes_fewer_splats() {
    let dir = Scratch::new();
    let store = boxes(&dir);
    let count = |more: &[&str]| {
        let out = dir.path("a.bsp");
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"splats", &store, &"-o", &out, &"--json"];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
        run(&args).json()["finest"].as_u64().unwrap()
    };
    assert!(count(&["--error", "0.1"]) * 3 < count(&[]));
}

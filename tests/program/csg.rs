//! `csg`: Booleans against brute force over the operands, crossings bit by bit, and what is refused.

use crate::support::*;
use brickfield_bench_data::{Mesh, shapes, write};
use brickfield_engine::brick::{Brick, HermiteEdge, SignChanges};
use brickfield_engine::lattice::{Axis, NodeKey, cross, dot, length, minus, unit};
use brickfield_engine::store::{BrickTree, Store};
use std::path::{Path, PathBuf};

/// A closed mesh as a file.
fn mesh(dir: &Scratch, name: &str, pieces: &[Mesh]) -> PathBuf {
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &Mesh::merged(pieces)).unwrap();
    dir.file(name, bytes)
}

fn cuboid(low: [f64; 3], high: [f64; 3]) -> Mesh {
    shapes::cuboid(low, high)
}

/// Two piles of bodies and a third: nested ones, coincident faces, parts that touch.
fn operands(dir: &Scratch) -> [PathBuf; 3] {
    let turned = |size: f64, angle: f64| cuboid([-size; 3], [size; 3]).rotated([1.0, 2.0, 3.0], angle);
    let a = [
        cuboid([0.0; 3], [20.0, 20.0, 10.0]),
        // Overlaps, so that w is 2, and a cavity.
        turned(4.0, 0.7).translated([6.0, 6.0, 8.0]),
        turned(2.0, 0.3).translated([15.0, 14.0, 5.0]).flipped(),
    ];
    let b = [
        // Shares a face with the block from within, and one from without.
        cuboid([10.0, 5.0, 5.0], [20.0, 12.0, 10.0]),
        cuboid([5.0, 15.0, 10.0], [9.0, 18.0, 13.0]),
        turned(3.0, 1.1).translated([4.0, 14.0, 9.0]),
    ];
    let c = [
        turned(6.0, 0.5).translated([12.0, 9.0, 8.0]),
        cuboid([1.0, 1.0, 1.0], [3.0, 3.0, 3.0]),
        cuboid([0.0, 0.0, 0.0], [20.0, 3.0, 10.0]),
    ];
    let stores =
        [("a", &a), ("b", &b), ("c", &c)].map(|(name, pieces)| (dir.path(&format!("{name}.brf")), pieces));
    for (n, (store, pieces)) in stores.iter().enumerate() {
        let stl = mesh(dir, &format!("{n}.stl"), &pieces[..]);
        let first = &stores[0].0;
        if n == 0 {
            run(&[&"build", &stl, &"-o", store, &"--cell", &"0.23", &"-q"]).ok_but_for("walls:");
        } else {
            run(&[&"build", &stl, &"-o", store, &"--like", first, &"-q"]).ok_but_for("walls:");
        }
    }
    stores.map(|(store, _)| store)
}

/// The samples of the deepest level.
fn samples(dir: &Scratch, store: &Path) -> Vec<f64> {
    let depth = Store::open(store, 0).unwrap().meta().depth.to_string();
    let npy = dir.path("w.npy");
    run(&[&"export", &store, &"--level", &depth, &"-o", &npy, &"-q"]).ok();
    Array::read(&npy).values
}

/// The edges of a leaf that change sign, with what crosses them; none of a node that is no such leaf.
fn edges(store: &Store, key: NodeKey) -> Vec<((usize, [usize; 3]), HermiteEdge)> {
    let is_leaf = store.node(key).is_some_and(|node| node.leaf);
    let Some(brick) = is_leaf.then(|| store.brick(key).unwrap()) else { return Vec::new() };
    let Brick::Counts { samples, hermite } = &*brick else { return Vec::new() };
    let signs = SignChanges::of(samples);
    let mut found = Vec::new();
    for axis in Axis::ALL {
        let mut of_axis = hermite.edges[axis.index()].iter();
        signs.for_edges(axis, |at| found.push(((axis.index(), at), *of_axis.next().expect("one an edge"))));
    }
    found
}

/// Whether every crossing of `result` is one of an operand's, whose normals are opposite where it is taken off.
fn require_crossings_of(result: &Path, operands: &[(&Path, f64)]) {
    let result = Store::open(result, 64 << 20).unwrap();
    let operands: Vec<(Store, f64)> =
        operands.iter().map(|(path, sign)| (Store::open(path, 64 << 20).unwrap(), *sign)).collect();
    let (mut checked, mut seen) = (0, vec![0; operands.len()]);
    for key in result.keys() {
        let of: Vec<_> = operands.iter().map(|(store, _)| edges(store, key)).collect();
        for (place, edge) in edges(&result, key) {
            let is_of = |n: usize| {
                let Ok(at) = of[n].binary_search_by_key(&place_order(place), |(p, _)| place_order(*p)) else {
                    return false;
                };
                let (there, here) = (of[n][at].1, edge);
                let [one, other] = [there.normal.to_vector(), here.normal.to_vector()];
                there.offset == here.offset
                    && (0..3).all(|a| (operands[n].1 * one[a] - other[a]).abs() < 1e-12)
            };
            let found: Vec<usize> = (0..of.len()).filter(|&n| is_of(n)).collect();
            assert!(!found.is_empty(), "{key} {place:?}");
            found.into_iter().for_each(|n| seen[n] += 1);
            checked += 1;
        }
    }
    assert!(checked > 1000 && seen.iter().all(|n| *n > 50), "{checked} {seen:?}");
}

fn place_order((axis, [i, j, k]): (usize, [usize; 3])) -> (usize, usize, usize, usize) {
    (axis, k, j, i)
}

fn csg(first: &Path, chain: &[(&str, &Path)], output: &Path, more: &[&str]) -> Run {
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"csg", &first, &"-o", &output];
    for (option, operand) in chain {
        args.push(option);
        args.push(operand);
    }
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
    run(&args)
}

#[test]
fn samples_and_crossings_are_those_of_the_operands() {
    let dir = Scratch::new();
    let [a, b, c] = operands(&dir);
    let [wa, wb, wc] = [&a, &b, &c].map(|store| samples(&dir, store));
    assert!(wa.iter().any(|w| *w > 1.0), "counts are clamped");
    let inside = |w: f64| w >= 1.0;
    let out = dir.path("out.brf");
    type Rule = fn(bool, bool, bool) -> bool;
    let chains: [(&[(&str, &Path)], Rule); 5] = [
        (&[("--minus", &b)], |a, b, _| a && !b),
        (&[("--plus", &b), ("--minus", &c)], |a, b, c| (a || b) && !c),
        (&[("--minus", &b), ("--plus", &c)], |a, b, c| a && !b || c),
        (&[("--and", &c), ("--plus", &b)], |a, b, c| a && c || b),
        (&[("--minus", &c), ("--and", &b)], |a, b, c| a && !c && b),
    ];
    for (chain, rule) in chains {
        csg(&a, chain, &out, &["-q"]).ok();
        run(&[&"verify", &out]).ok();
        let found = samples(&dir, &out);
        for (n, w) in found.iter().enumerate() {
            let expected = rule(inside(wa[n]), inside(wb[n]), inside(wc[n]));
            assert_eq!(*w, f64::from(u8::from(expected)), "{chain:?} {n}");
        }
        let sign = |option: &str| if option == "--minus" { -1.0 } else { 1.0 };
        let mut operands: Vec<(&Path, f64)> = vec![(&a, 1.0)];
        operands.extend(chain.iter().map(|(option, path)| (*path, sign(option))));
        require_crossings_of(&out, &operands);
        let mesh = dir.path("out.stl");
        run(&[&"mesh", &out, &"-o", &mesh, &"--check", &"-q"]).ok();
    }
}

#[test]
fn counts_stay_where_they_are_asked_for() {
    let dir = Scratch::new();
    let [a, b, _] = operands(&dir);
    let [wa, wb] = [&a, &b].map(|store| samples(&dir, store));
    let out = dir.path("out.brf");
    csg(&a, &[("--minus", &b)], &out, &["-q", "--keep-counts"]).ok();
    for (n, w) in samples(&dir, &out).iter().enumerate() {
        assert_eq!(*w, if wb[n] >= 1.0 { 0.0 } else { wa[n].max(0.0) }, "{n}");
    }
    csg(&a, &[("--plus", &b)], &out, &["-q", "--keep-counts"]).ok();
    for (n, w) in samples(&dir, &out).iter().enumerate() {
        assert_eq!(*w, if wb[n] >= 1.0 { wa[n].max(1.0) } else { wa[n].max(0.0) }, "{n}");
    }
    run(&[&"verify", &out]).ok();
}

#[test]
fn bytes_do_not_depend_on_threads_and_a_killed_run_goes_on_to_them() {
    let dir = Scratch::new();
    let [a, b, c] = operands(&dir);
    let out = dir.path("out.brf");
    let chain: [(&str, &Path); 2] = [("--minus", &b), ("--plus", &c)];
    let bytes = |more: &[&str]| {
        csg(&a, &chain, &out, &[&["-q"], more].concat()).ok();
        std::fs::read(&out).unwrap()
    };
    let one = bytes(&["--threads", "1"]);
    for more in
        [&["--threads", "2"] as &[&str], &["--threads", "3", "--memory", "64MiB"], &["--commit-every", "0"]]
    {
        assert!(bytes(more) == one, "{more:?}");
    }
    assert_eq!(dir.names().iter().filter(|name| name.starts_with("out")).collect::<Vec<_>>(), ["out.brf"]);
}

#[test]
fn inputs_are_built_for_the_time_of_the_command() {
    let dir = Scratch::new();
    let [a, b, _] = operands(&dir);
    let (by_store, by_mesh) = (dir.path("s.brf"), dir.path("m.brf"));
    csg(&a, &[("--minus", &b)], &by_store, &["-q"]).ok();
    csg(&a, &[("--minus", &dir.path("1.stl"))], &by_mesh, &["-q"]).ok_but_for("walls:");
    require_same_tree(&by_store, &by_mesh);
    assert!(dir.names().iter().all(|name| !name.contains("operand")), "{:?}", dir.names());
}

/// Two stores with the same nodes, samples and crossings.
fn require_same_tree(one: &Path, other: &Path) {
    let [one, other] = [one, other].map(|path| Store::open(path, 0).unwrap());
    assert_eq!(one.keys(), other.keys());
    for key in one.keys() {
        assert!(one.brick(key).unwrap() == other.brick(key).unwrap(), "{key}");
    }
}

#[test]
fn a_box_without_a_file_is_the_box_of_its_facets() {
    let dir = Scratch::new();
    let [a, ..] = operands(&dir);
    let facets = mesh(&dir, "box.stl", &[cuboid([3.1, -1.0, 2.7], [14.3, 12.5, 12.25])]);
    let (store, by_store, by_body) = (dir.path("box.brf"), dir.path("s.brf"), dir.path("m.brf"));
    run(&[&"build", &facets, &"-o", &store, &"--like", &a, &"-q"]).ok();
    for option in ["--minus", "--and"] {
        csg(&a, &[(option, &store)], &by_store, &["-q"]).ok();
        csg(&a, &[(option, Path::new("box 3.1,-1,2.7,14.3,12.5mm,12250um"))], &by_body, &["-q"]).ok();
        let (one, other) = (samples(&dir, &by_store), samples(&dir, &by_body));
        assert!(one == other);
        require_crossings_of(&by_body, &[(&a, 1.0), (&store, if option == "--minus" { -1.0 } else { 1.0 })]);
    }
}

#[test]
fn bodies_have_the_volumes_of_their_formulas() {
    let dir = Scratch::new();
    let block = mesh(&dir, "block.stl", &[cuboid([0.0; 3], [20.0; 3])]);
    let (part, out) = (dir.path("part.brf"), dir.path("out.brf"));
    run(&[&"build", &block, &"-o", &part, &"--depth", &"2", &"-q"]).ok();
    let pi = std::f64::consts::PI;
    for (body, volume) in [
        ("z>12.3mm", 400.0 * 7.7),
        ("x<0.5cm", 400.0 * 5.0),
        ("cylinder 9.7,10.3,r8mm,y", pi * 64.0 * 20.0),
        ("cylinder 9.3,10.1,r8,z,-1,7.5", pi * 64.0 * 7.5),
        ("sphere 9.7,10.2,9.9,r8.1", 4.0 / 3.0 * pi * 8.1f64.powi(3)),
    ] {
        for (option, expected) in [("--minus", 8000.0 - volume), ("--and", volume)] {
            csg(&part, &[(option, Path::new(body))], &out, &["-q"]).ok();
            let found = run(&[&"info", &out, &"--volume", &"--json"]).json();
            let volumes = &found["volumes"];
            let (union, error) =
                (volumes["union"].as_f64().unwrap(), volumes["union_error"].as_f64().unwrap());
            assert!((union - expected).abs() <= error, "{option} {body}: {union} ± {error}, {expected}");
            assert!((union / expected - 1.0).abs() < 5e-4, "{option} {body}: {union}, {expected}");
        }
    }
    csg(&part, &[("--plus", Path::new("sphere 19,10,10,r2"))], &out, &[]).misused();
}

#[test]
fn what_cannot_be_combined_is_refused_and_nothing_is_written() {
    let dir = Scratch::new();
    let [a, ..] = operands(&dir);
    let out = dir.path("out.brf");
    let other = dir.store("overlap_boxes", 1);
    let refused = csg(&a, &[("--minus", &other)], &out, &[]).failed();
    assert!(refused.contains("--like") && refused.contains("samples do not stand"), "{refused}");
    let open = stl("open_box_no_lid");
    let refused = csg(&dir.store("overlap_boxes", 1), &[("--plus", &open)], &out, &[]).failed();
    assert!(refused.contains("open_box_no_lid"), "{refused}");
    let refused = csg(&a, &[("--minus", &dir.path("none.brf"))], &out, &[]).failed();
    assert!(refused.contains("none.brf"), "{refused}");
    let refused = csg(&a, &[("--minus", &a)], &a, &[]).failed();
    assert!(refused.contains("overwrite"), "{refused}");
    // The same lattice, and boundaries on two levels.
    let coarse = dir.path("coarse.brf");
    run(&[&"cache", &"prune", &dir.path("b.brf"), &"-o", &coarse, &"--level", &"1", &"-q"]).ok();
    let refused = csg(&a, &[("--minus", &coarse)], &out, &[]).failed();
    assert!(refused.contains("coarse.brf: its leaf") && refused.contains("--like"), "{refused}");
    for body in ["z>", "box 1,2,3", "sphere 1,2,3,r0"] {
        csg(&a, &[("--minus", Path::new(body))], &out, &[]).misused();
    }
    let refused = csg(&a, &[("--minus", Path::new("box 3,3,3,1,1,1"))], &out, &[]).misused();
    assert!(
        refused.contains("'box 3,3,3,1,1,1': the body holds nothing; give least coordinates"),
        "{refused}"
    );
    // Not files that are missing, but bodies that are mistyped.
    for body in ["z=5", "w>5", "sphere", "box:0,0,0,1,1,1", "cone 5,5,5,r2", "Sphere(5,5,5,2)"] {
        let refused = csg(&a, &[("--minus", Path::new(body))], &out, &[]).misused();
        assert!(refused.contains("no body that is known; give `z>20mm`"), "{refused}");
    }
    let far = mesh(&dir, "far.stl", &[cuboid([90.0; 3], [95.0; 3])]);
    let refused = csg(&a, &[("--minus", &far)], &out, &[]).failed();
    assert!(refused.contains("far.stl: the input spans"), "{refused}");
    csg(&a, &[("--plus", Path::new("z>3"))], &out, &[]).misused();
    csg(&a, &[], &out, &[]).misused();
    assert!(dir.names().iter().all(|name| !name.starts_with("out")), "{:?}", dir.names());
}

#[test]
fn a_part_of_which_nothing_is_left_is_told_and_measures_are_refused_in_a_line() {
    let dir = Scratch::new();
    let part = dir.store("overlap_boxes", 1);
    let none = dir.path("none.brf");
    let made = csg(&part, &[("--minus", &part)], &none, &[]);
    assert!(made.stderr.contains("none.brf: nothing is left of the part"), "{}", made.stderr);
    assert_eq!(made.stderr.lines().count(), 1);
    run(&[&"verify", &none]).ok();
    let (ply, stl) = (dir.path("out.ply"), dir.path("out.stl"));
    for (told, words) in [
        (run(&[&"thickness", &none, &"-o", &ply]), "none.brf: the store has no surface"),
        (run(&[&"deviation", &none, &part, &"-o", &ply]), "none.brf: the store has no surface"),
        (run(&[&"deviation", &part, &none, &"-o", &ply]), "none.brf: the store has no surface"),
        (run(&[&"offset", &none, &"--by", &"1", &"-o", &dir.path("out.brf")]), "the store has no surface"),
        (run(&[&"mesh", &none, &"-o", &stl, &"--triangles", &"100"]), "no cells leave anything of the part"),
        (run(&[&"mesh", &none, &"-o", &stl, &"--max-size", &"9kB"]), "no cells leave anything of the part"),
    ] {
        let refused = told.failed();
        assert!(refused.contains(words), "{refused}");
    }
    assert!(dir.names().iter().all(|name| !name.starts_with("out")), "{:?}", dir.names());
}

#[test]
fn a_killed_run_leaves_no_store_and_the_next_one_has_the_same_bytes() {
    let dir = Scratch::new();
    let part = dir.store("clover_beads", 4);
    let out = dir.path("out.brf");
    let body = Path::new("sphere 30,30,10,r25");
    csg(&part, &[("--minus", body)], &out, &["-q"]).ok();
    let whole = std::fs::read(&out).unwrap();
    let mut killed = 0;
    for wait in [10, 30, 60, 100, 150] {
        std::fs::remove_file(&out).unwrap();
        let mut command = program();
        command.arg("csg").arg(&part).arg("--minus").arg(body).arg("-o").arg(&out);
        command.args(["-q", "--commit-every", "0.005", "--threads", "1"]);
        let mut child = command.spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(wait));
        child.kill().unwrap();
        killed += u32::from(!child.wait().unwrap().success());
        let names = dir.names();
        let left = names.iter().filter(|name| name.starts_with("out")).map(String::as_str);
        assert!(left.clone().all(|name| ["out.brf", "out.brf.part", "out.brf.journal"].contains(&name)));
        csg(&part, &[("--minus", body)], &out, &["-q"]).ok();
        assert!(std::fs::read(&out).unwrap() == whole, "after {wait} ms");
        assert_eq!(dir.names().iter().filter(|name| name.starts_with("out")).count(), 1);
    }
    assert!(killed > 0);
}

/// Piles at random and on a coarse grid, whose faces coincide and lie at 45 degrees, against each other.
#[test]
fn random_piles_are_combined_sample_by_sample() {
    use brickfield_bench_data::pile::{lattice_pile, random_pile};
    let dir = Scratch::new();
    let out = dir.path("out.brf");
    for seed in 1..=3u64 {
        let pile = |seed: u64| match seed % 10 {
            1 => random_pile(seed, 12),
            _ => lattice_pile(seed, 12, 1, 16),
        };
        // The first one's lattice has room for both.
        let mut first = pile(seed);
        first.extend([cuboid([-40.0; 3], [-39.0; 3]), cuboid([60.0; 3], [61.0; 3])]);
        let a = mesh(&dir, "a.stl", &first);
        let b = mesh(&dir, "b.stl", &pile(seed + 10));
        let (sa, sb) = (dir.path("a.brf"), dir.path("b.brf"));
        run(&[&"build", &a, &"-o", &sa, &"--depth", &"2", &"-q"]).ok_but_for("brf: ");
        run(&[&"build", &b, &"-o", &sb, &"--like", &sa, &"-q"]).ok_but_for("brf: ");
        let [wa, wb] = [&sa, &sb].map(|store| samples(&dir, store));
        for (option, rule) in [
            ("--minus", (|a, b| a && !b) as fn(bool, bool) -> bool),
            ("--plus", |a, b| a || b),
            ("--and", |a, b| a && b),
        ] {
            csg(&sa, &[(option, &sb)], &out, &["-q"]).ok();
            run(&[&"verify", &out]).ok();
            for (n, w) in samples(&dir, &out).iter().enumerate() {
                let expected = rule(wa[n] >= 1.0, wb[n] >= 1.0);
                assert_eq!(*w, f64::from(u8::from(expected)), "{seed} {option} {n}");
            }
            let mesh = dir.path("out.stl");
            run(&[&"mesh", &out, &"-o", &mesh, &"--check", &"-q"]).ok();
        }
    }
}

/// Points anywhere against the sums over all facets of both inputs.
#[test]
fn points_at_samples_have_what_the_inputs_say() {
    let dir = Scratch::new();
    let [a, b, _] = operands(&dir);
    let out = dir.path("out.brf");
    csg(&a, &[("--minus", &b)], &out, &["-q"]).ok();
    let store = Store::open(&out, 0).unwrap();
    let (root, depth) = (store.root(), store.meta().depth);
    let (mut state, mut rows) = (7u64, String::from("x,y,z\n"));
    for _ in 0..3000 {
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        // At samples, so that nothing is interpolated.
        let spacing = f64::from(1u32 << (19 - depth));
        let axis = f64::from(32u32 << depth);
        let at = root.to_world([0; 3].map(|_: i32| (random() * axis).floor() * spacing + 1.0));
        rows += &format!("{:?},{:?},{:?}\n", at[0], at[1], at[2]);
    }
    let points = dir.file("points.csv", rows);
    let last = |text: String| -> Vec<f64> {
        text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
    };
    let found = last(run(&[&"sample", &out, &"--points", &points]).ok());
    let of = |n: usize| {
        let input = dir.path(&format!("{n}.stl"));
        last(run(&[&"winding", &input, &"--points", &points, &"--brute"]).ok())
    };
    let (wa, wb) = (of(0), of(1));
    assert_eq!(found.len(), 3000);
    for n in 0..found.len() {
        // Facets are snapped for the store; a point so near to one may be on either side.
        let is_clear = [wa[n], wb[n]].iter().all(|w| (w - w.round()).abs() < 0.1);
        let expected = wa[n] >= 0.5 && wb[n] < 0.5;
        assert!(
            !is_clear || found[n] == f64::from(u8::from(expected)),
            "{n}: {} {} {}",
            wa[n],
            wb[n],
            found[n]
        );
    }
    assert!(found.iter().sum::<f64>() > 100.0);
}

/// The planes of a convex mesh: unit normals outward, and places on them.
fn planes(mesh: &Mesh) -> Vec<([f64; 3], [f64; 3])> {
    let plane = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        (unit(cross(minus(b, a), minus(c, a))), a)
    };
    let mut planes: Vec<([f64; 3], [f64; 3])> = Vec::new();
    for (normal, at) in mesh.triangles.iter().map(plane) {
        if !planes.iter().any(|(other, _)| dot(*other, normal) > 0.9999) {
            planes.push((normal, at));
        }
    }
    planes
}

/// Where faces of one convex mesh meet those of another: the edges that a Boolean makes of them.
fn new_edges(one: &Mesh, other: &Mesh) -> Vec<[[f64; 3]; 2]> {
    let (first, second) = (planes(one), planes(other));
    let mut edges = Vec::new();
    for ((n, p), (m, q)) in first.iter().flat_map(|a| second.iter().map(move |b| (*a, *b))) {
        let along = cross(n, m);
        let square = dot(along, along);
        if square < 1e-6 {
            continue;
        }
        let (c, d) = (dot(n, p), dot(m, q));
        let [u, v] = [cross(m, along), cross(along, n)];
        let at: [f64; 3] = std::array::from_fn(|a| (c * u[a] + d * v[a]) / square);
        let (mut from, mut to) = (f64::MIN, f64::MAX);
        for (normal, on) in first.iter().chain(&second) {
            let (rate, gap) = (dot(*normal, along), dot(*normal, minus(*on, at)));
            if rate > 1e-9 {
                to = to.min(gap / rate);
            } else if rate < -1e-9 {
                from = from.max(gap / rate);
            } else if gap < -1e-9 {
                to = f64::MIN;
            }
        }
        if from < to {
            edges.push([from, to].map(|t| std::array::from_fn(|a| at[a] + t * along[a])));
        }
    }
    edges
}

fn to_segment(p: [f64; 3], [a, b]: [[f64; 3]; 2]) -> f64 {
    let (along, from) = (minus(b, a), minus(p, a));
    let t = (dot(along, from) / dot(along, along)).clamp(0.0, 1.0);
    length(std::array::from_fn(|n| from[n] - t * along[n]))
}

#[test]
fn edges_where_two_bodies_meet_are_sharp() {
    let (mut creased, mut worst) = (0, 0.0f64);
    for seed in 0..3 {
        let dir = Scratch::new();
        let angle = 0.3 + 0.41 * f64::from(seed);
        let body = cuboid([-9.0, -7.0, -6.0], [9.0, 7.0, 6.0]).rotated([1.0, 2.0, 3.0], angle);
        let taken = cuboid([-4.0, -5.0, -8.0], [5.0, 4.0, 8.0])
            .rotated([2.0, -1.0, 1.5], 0.8 - angle)
            .translated([4.0, 3.0, 2.0]);
        let [a, b, out, stl] = ["a.brf", "b.brf", "out.brf", "out.stl"].map(|name| dir.path(name));
        let [of_a, of_b] =
            [("a.stl", &body), ("b.stl", &taken)].map(|(n, m)| mesh(&dir, n, std::slice::from_ref(m)));
        run(&[&"build", &of_a, &"-o", &a, &"--cell", &"0.2", &"-q"]).ok();
        run(&[&"build", &of_b, &"-o", &b, &"--like", &a, &"-q"]).ok();
        run(&[&"csg", &a, &"--minus", &b, &"-o", &out, &"-q"]).ok();
        run(&[&"mesh", &out, &"-o", &stl, &"--follow-creases", &"--check", &"-q"]).ok();
        let store = Store::open(&out, 0).unwrap();
        let (root, depth) = (store.meta().root, store.meta().depth);
        let (cell, step) = (root.spacing(depth), f64::from(1u32 << (19 - depth)));
        let edges = new_edges(&body, &taken);
        assert!(edges.len() >= 6, "{seed}: {}", edges.len());
        let near = |p: [f64; 3]| edges.iter().map(|edge| to_segment(p, *edge)).fold(f64::MAX, f64::min);
        let ends =
            |p: [f64; 3]| edges.iter().flatten().map(|end| length(minus(p, *end))).fold(f64::MAX, f64::min);
        for corner in facets_of(&stl).into_iter().flatten() {
            let p = corner.map(f64::from);
            let places = root.to_units(p).map(|u| (u - 1.0) / step);
            // What keeps triangles apart stands on faces of cells.
            if places.iter().any(|place| (place - place.round()).abs() < 1e-3) {
                continue;
            }
            // The edge passes through the middle of the vertex's cell, so that the cell's edges see both faces.
            let middle = places.map(|place| (place.floor() + 0.5) * step + 1.0);
            if near(root.to_world(middle)) < 0.2 * cell && ends(p) > 2.0 * cell {
                (creased, worst) = (creased + 1, worst.max(near(p) / cell));
            }
        }
    }
    assert!(creased > 500, "{creased}");
    assert!(worst <= 0.02, "{worst} cells, of {creased}");
}

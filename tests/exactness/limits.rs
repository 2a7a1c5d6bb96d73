//! What is refused, and what is only just accepted.

use crate::scene::{Scene, compare_brick, nodes};
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::{Mesh, Rng, shapes};
use brickfield_engine::build::TreeOptions;
use brickfield_engine::ingest::Facet;
use brickfield_engine::store::Refine;

const MODES: [Refine; 3] = [Refine::Hidden, Refine::Stddev, Refine::Surface];

fn message(scene: &Scene, options: TreeOptions) -> String {
    scene.try_build(options).err().unwrap_or_else(|| panic!("{options:?} was accepted")).to_string()
}

#[test]
fn open_input_is_refused() {
    let mesh = Mesh::merged(&random_pile(1, 4));
    let whole = Scene::around(mesh.facets().collect());
    for missing in [0, whole.soup.len() / 2, whole.soup.len() - 1] {
        let mut open = whole.clone();
        open.soup.remove(missing);
        let mut turned = whole.clone();
        turned.soup[missing].swap(0, 1);
        let mut doubled = whole.clone();
        doubled.soup.push(doubled.soup[missing]);
        for scene in [open, turned, doubled] {
            for refine in MODES {
                let error =
                    message(&scene, TreeOptions { depth: 2, refine, stddev: 0.0, ..Default::default() });
                assert!(error.contains("open edges"), "{error}");
            }
        }
    }
}

/// Moves every corner of every facet by an ulp of f32 or not at all, each facet on its own.
fn torn(soup: &[Facet], seed: u64) -> Vec<Facet> {
    let mut rng = Rng::new(seed);
    let mut nudge = |c: f64| {
        let c = c as f32;
        f64::from([c.next_down(), c, c.next_up()][rng.below(3) as usize])
    };
    soup.iter().map(|t| t.map(|v| v.map(&mut nudge))).collect()
}

#[test]
fn vertices_torn_by_an_ulp_are_welded() {
    // Vertices on even units of a cube whose unit is far above the ulp: snapping puts them back.
    let pile = brickfield_bench_data::pile::lattice_pile(6, 5, 4096, 40);
    let mesh = Mesh::merged(&pile).translated([1_000_000.0; 3]);
    let whole = Scene::in_units(&mesh);
    let scene = Scene { soup: torn(&whole.soup, 1), root: whole.root };
    assert!(scene.soup != whole.soup);
    for refine in MODES {
        let options = TreeOptions { depth: 4, refine, stddev: 0.0, ..Default::default() };
        let (a, b) = (nodes(&scene.build(options)), nodes(&whole.build(options)));
        assert!(a == b);
    }
}

/// Facets that snapping leaves without area stay part of the closed soup, and cross nothing.
#[test]
fn facets_that_collapse_do_no_harm() {
    let mut pieces = random_pile(4, 5);
    pieces.push(shapes::icosphere(4, 1e-7).translated([0.5, 0.4, 0.3]));
    pieces.push(shapes::torus(1.0, 1e-8, 40, 5));
    let scene = Scene::of(&pieces);
    let oracle = scene.oracle();
    let flat = oracle.facets.iter().filter(|t| crate::oracle::normal(t) == [0; 3]).count();
    assert!(flat > 1_000, "{flat}");
    for (key, _, brick) in nodes(&scene.at_depth(2)) {
        compare_brick(&oracle, key, &brick);
    }
}

#[test]
fn a_soup_without_area_is_empty_space() {
    let line = |a: f64, b: f64| [[a, 0.0, 0.0], [b, 0.0, 0.0], [a, 0.0, 0.0]];
    let scene = Scene::around(vec![line(0.0, 1.0), line(1.0, 3.0)]);
    for refine in MODES {
        let tree = nodes(&scene.build(TreeOptions { depth: 3, refine, stddev: 0.0, ..Default::default() }));
        assert_eq!(tree.len(), 1);
        assert_eq!(tree[0].2.range(), (0, 0));
    }
}

/// `copies` of a tetrahedron that holds a few samples, in a cube that another piece spans.
fn crowd(copies: usize, reversed: bool) -> Scene {
    let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
    let one = shapes::tetrahedron(corners).translated([10.0, 9.0, 11.0]);
    let one = if reversed { one.flipped() } else { one };
    let frame = [[0.0; 3], [31.0; 3]].map(|at: [f64; 3]| shapes::octahedron(0.2).translated(at));
    let mut soup: Vec<Facet> = Mesh::merged(&frame).facets().collect();
    soup.extend((0..copies).flat_map(|_| one.facets()));
    Scene::around(soup)
}

#[test]
fn thirty_thousand_shells_are_counted() {
    for (reversed, expected) in [(false, (0, 30_000)), (true, (-30_000, 0))] {
        let scene = crowd(30_000, reversed);
        for refine in MODES {
            let tree =
                nodes(&scene.build(TreeOptions { depth: 2, refine, stddev: 0.0, ..Default::default() }));
            let range = tree.iter().map(|n| n.2.range()).fold((0, 0), |m, r| (m.0.min(r.0), m.1.max(r.1)));
            // The frame's small pieces add none to them.
            assert!(range == expected || range == (expected.0, expected.1.max(1)), "{range:?}");
        }
    }
    let scene = crowd(32_767, false);
    let tree = nodes(&scene.at_depth(1));
    assert_eq!(tree.iter().map(|n| n.2.range().1).max(), Some(i16::MAX));
}

#[test]
fn more_shells_than_fit_are_an_error_that_says_so() {
    for (copies, reversed) in [(32_768, false), (33_000, false), (33_000, true), (66_000, false)] {
        let scene = crowd(copies, reversed);
        for refine in MODES {
            for depth in [0, 2] {
                let error = message(&scene, TreeOptions { depth, refine, stddev: 0.0, ..Default::default() });
                assert!(error.contains("more than 32767 shells overlap"), "{error}");
            }
        }
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let scene = Scene::of(&random_pile(1, 1));
    for (depth, stddev) in [(17, 0.0), (255, 0.0), (2, -0.1), (2, f64::NAN), (2, f64::INFINITY)] {
        message(&scene, TreeOptions { depth, stddev, refine: Refine::Stddev, ..Default::default() });
    }
}

//! Places that 32 bits hardly tell apart: crossings next to samples, and cells few steps wide far from the origin.

use super::meetings::pairs;
use super::*;
use crate::contour::frame::CellFrame;
use crate::lattice::{BRICK_CELLS, Octant, RootCube};

/// Noise whose crossings stand at the ends of their edges or next to them, but for a sixteenth of them.
struct Ends(NoiseField);

impl SampledField for Ends {
    fn winding(&self, at: Units) -> i16 {
        self.0.winding(at)
    }

    fn crossing(&self, low: Units, high: Units) -> ([f64; 3], f64) {
        let (normal, t) = self.0.crossing(low, high);
        let offset = (t * 65536.0) as u32;
        let offset = match offset >> 12 {
            0 => offset,
            1 => 1 << 15,
            2 | 3 => 1,
            4 | 5 => 65534,
            n if n % 2 == 0 => 0,
            _ => 65535,
        };
        (normal, f64::from(offset) / 65536.0)
    }
}

/// A root cube that has its farthest corner at this distance from the origin along an axis, and none of whose planes
/// are round numbers.
fn far_away(far: f64) -> RootCube {
    let edge = 15.83;
    RootCube { origin: [far - edge, 0.77 * far - 3.1, -far], edge }
}

/// Cells are 500,000 to 8 steps wide, less than which is refused.
#[test]
fn places_are_apart_in_32_bits() {
    let (mut split, mut on_faces) = (0, 0);
    // With the widest and the narrowest cells of both levels in any case.
    let all = [16.0, 80.0, 1000.3, 2e4, 1.3e5, 2.5e5, 5.1e5];
    let is_wanted = |n: &usize| part_or_all([0, 3, 5, 6].contains(n), true);
    for (n, far) in all.into_iter().enumerate().filter(|(n, _)| is_wanted(n)) {
        for level in 0..=u8::from(far < 3e5) {
            let seed = 2 * n as u64 + u64::from(level);
            let density = [60, 110, 160, 200][seed as usize % 4];
            let shape = match level {
                0 => NoiseField {
                    seed,
                    boxes: vec![[[1 << 19; 3], [31 << 19; 3]]],
                    density,
                    radius: 0.0,
                    quiet_bits: 24,
                },
                _ => noise(seed, 1, 5, density, 0.0),
            };
            let (mesh, summary) = checked(&tree_at(far_away(far), &Ends(shape), &uniform(level)));
            assert_eq!(pairs(&mesh), 0, "{far} at level {level}: {summary:?}");
            check(&mesh.welded()).unwrap();
            split += summary.split_faces;
            on_faces += summary.face_vertices;
        }
    }
    let least = part_or_all(2500, 5000);
    assert!(split > least && on_faces > least, "{split} {on_faces}");
}

/// The same where leaves of three levels are next to each other; cells of the deepest are 8 steps wide at least.
#[test]
fn places_are_apart_in_32_bits_between_levels() {
    let (mut mixed, mut meeting) = (0, Vec::new());
    for (n, far) in [16.0, 80.0, 1000.3, 2e4, 6e4].into_iter().enumerate().step_by(part_or_all(2, 1)) {
        let seed = n as u64;
        let shape = noise(seed, 1, 4, [60, 110, 160, 200][n % 4], 0.0);
        let tree = tree_at(far_away(far), &Ends(shape), &random_divide(seed, (1, 3), 110));
        let (mesh, summary) = checked(&tree);
        meeting.push(pairs(&mesh));
        mixed += summary.mixed_cells;
    }
    assert_eq!((meeting, mixed > 1000), (vec![0; part_or_all(3, 5)], true));
}

/// Merged vertices stay away from those on faces and edges.
#[test]
fn places_are_apart_in_32_bits_with_a_tolerance() {
    for (seed, far) in [80.0, 1000.3, 1.3e5].into_iter().enumerate() {
        let tree = tree_at(far_away(far), &Ends(noise(seed as u64, 1, 5, 100, 0.0)), &uniform(1));
        let options = ContourOptions { tolerance: 0.1, ..Default::default() };
        let (mesh, summary) = mesh(&tree, &options);
        mesh.check();
        assert_eq!(pairs(&mesh), 0, "{far}: {summary:?}");
        check(&mesh.welded()).unwrap();
    }
}

/// Where a plane of samples lies half way between two numbers of 32 bits, sums in another order round to the other one.
#[test]
fn bricks_have_the_same_numbers_for_a_plane_of_samples() {
    for seed in 0..200 {
        let edge = 1.0 + (hash(seed) >> 40) as f64 / 1e5;
        let path = (0..3).map(|n| Octant::all().nth((hash(seed ^ n << 8) % 7) as usize).unwrap());
        let key = path.fold(NodeKey::ROOT, NodeKey::child);
        let Some(above) = key.neighbour([1; 3]) else { continue };
        let plane = RootCube { origin: [0.0; 3], edge }.to_world(above.base().map(|b| f64::from(b) + 1.0));
        let half_way = plane.map(|c| {
            let at = (c * 1.7) as f32;
            (f64::from(at) + f64::from(at.next_up())) / 2.0
        });
        let root = RootCube { origin: std::array::from_fn(|a| half_way[a] - plane[a]), edge };
        let (below, above) = (CellFrame::new(root, key), CellFrame::new(root, above));
        for a in 0..3 {
            assert_eq!(below.lattice()[a][BRICK_CELLS], above.lattice()[a][0], "{seed}");
        }
        assert_eq!(below.bounds()[1], above.bounds()[0]);
    }
}

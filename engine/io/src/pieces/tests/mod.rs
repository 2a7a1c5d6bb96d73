//! Pieces of small soups: boxes beside, in and through each other, with facets turned over.

use super::*;
use crate::Silent;
use crate::ingest::Facet;
use brickfield_winding::winding::winding_at;
use proptest::prelude::*;

type Soup = Vec<Facet>;

/// A box with outward faces.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Soup {
    let corner = |c: usize| -> [f64; 3] { [0, 1, 2].map(|a| if c >> a & 1 == 1 { high[a] } else { low[a] }) };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = |q: &[usize; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]];
    quads.iter().flat_map(halves).map(|t| t.map(corner)).collect()
}

fn cube(low: f64, high: f64) -> Soup {
    cuboid([low; 3], [high; 3])
}

fn reversed(soup: Soup) -> Soup {
    soup.into_iter().map(|[a, b, c]| [a, c, b]).collect()
}

/// Some of the soups reversed, and all of them one after the other.
fn joined(soups: &[Soup], inward: &[bool]) -> Soup {
    let turned = |(soup, &inward): (&Soup, &bool)| if inward { reversed(soup.clone()) } else { soup.clone() };
    soups.iter().zip(inward).flat_map(turned).collect()
}

/// A root around all tests.
fn root() -> RootCube {
    RootCube::around([-100.0; 3], [100.0; 3]).unwrap()
}

fn studied(files: &[Soup], consistency: Consistency) -> (PiecesReport, Vec<Soup>) {
    let sources: Vec<&dyn Facets> = files.iter().map(|soup| soup as &dyn Facets).collect();
    let (report, turned) = study(&sources, root(), consistency, u64::MAX, &Silent).unwrap();
    let read = |source: &FlippedSource| {
        let mut out = Vec::new();
        source.read(0..source.facets(), &mut out);
        // Read in parts it is the same.
        let mut part = Vec::new();
        source.read(1..source.facets(), &mut part);
        assert_eq!(part, out[1..]);
        out
    };
    (report, turned.apply(&sources).iter().map(read).collect())
}

/// What is said of one soup, and what becomes of it.
fn oriented(soup: &Soup, consistency: Consistency) -> (PiecesReport, Soup) {
    let (report, mut soups) = studied(std::slice::from_ref(soup), consistency);
    (report, soups.remove(0))
}

fn given(soup: &Soup) -> (PiecesReport, Soup) {
    oriented(soup, Consistency::Given)
}

fn sought(soup: &Soup) -> (PiecesReport, Soup) {
    oriented(soup, Consistency::Sought)
}

fn at(soup: &Soup, points: &[[f64; 3]]) -> Vec<i64> {
    winding_at(&[soup], root(), points, &Silent).unwrap()
}

#[test]
fn a_reversed_box_is_found_and_turned() {
    let soups = [cube(0.0, 10.0), cuboid([20.0, 0.0, 0.0], [30.0, 10.0, 5.0])];
    let good = joined(&soups, &[false, false]);
    let (report, same) = given(&good);
    assert_eq!((report.pieces, report.inside_out, report.turned_facets), (2, None, 0));
    assert_eq!(same, good);
    let (report, turned) = given(&joined(&soups, &[false, true]));
    let found = report.inside_out.unwrap();
    assert_eq!((found.pieces, found.source, found.facet), (1, 0, 13));
    assert!((found.volume - 500.0).abs() < 1e-2, "{}", found.volume);
    assert_eq!((report.turned_facets, report.open, report.cavities), (12, 0, 0));
    assert_eq!(turned, good);
    // The largest is named.
    let found = given(&joined(&[soups[1].clone(), soups[0].clone()], &[true, true])).0.inside_out.unwrap();
    assert_eq!((found.pieces, found.facet), (2, 13));
}

#[test]
fn files_have_their_own_numbers() {
    let files = [cube(0.0, 1.0), reversed(cube(5.0, 9.0)), cube(20.0, 22.0)];
    let (report, turned) = studied(&files, Consistency::Given);
    let found = report.inside_out.unwrap();
    assert_eq!((found.source, found.facet, report.pieces), (1, 1, 3));
    assert_eq!(turned, [cube(0.0, 1.0), cube(5.0, 9.0), cube(20.0, 22.0)]);
}

#[test]
fn nested_boxes_become_what_they_were() {
    let soups = [cube(0.0, 30.0), cube(10.0, 20.0), cube(13.0, 17.0)];
    let points = [[5.0; 3], [11.0; 3], [15.0; 3]];
    for inward in 0..8u8 {
        let inward = [0, 1, 2].map(|piece| inward >> piece & 1 == 1);
        let (report, turned) = given(&joined(&soups, &inward));
        // None of these is reversed, or only the smallest, within a box that is solid.
        let expected = match inward {
            [false, false, false] => [1, 2, 3],
            [false, false, true] => [1, 2, 1],
            _ => [1, 0, 1],
        };
        assert_eq!(at(&turned, &points), expected, "{inward:?}");
        let negative = at(&joined(&soups, &inward), &points).iter().any(|w| *w < 0);
        assert_eq!(report.inside_out.is_some(), negative, "{inward:?}: {report:?}");
    }
}

#[test]
fn a_cavity_is_no_fault() {
    for (file, cavities) in [
        (joined(&[cube(0.0, 30.0), cube(10.0, 20.0)], &[false, true]), 1),
        // With a wall, an edge and a corner in common with the box around it.
        (joined(&[cube(0.0, 30.0), cuboid([0.0, 10.0, 10.0], [5.0, 20.0, 20.0])], &[false, true]), 1),
        (joined(&[cube(0.0, 30.0), cube(0.0, 5.0)], &[false, true]), 1),
        (joined(&[cube(0.0, 30.0), cube(1.0, 5.0), cube(6.0, 12.0)], &[false, true, true]), 2),
        (joined(&[cube(1.0, 5.0), cube(0.0, 30.0)], &[true, false]), 1),
    ] {
        let (report, turned) = given(&file);
        assert_eq!((report.inside_out, report.cavities, report.turned_facets), (None, cavities, 0));
        assert_eq!(turned, file);
        // The whole inside out comes back as it was.
        let (report, turned) = given(&reversed(file.clone()));
        assert_eq!(report.inside_out.map(|found| found.pieces), Some(1));
        assert_eq!((report.cavities, &turned), (cavities, &file));
    }
}

#[test]
fn what_is_partly_outside_is_turned() {
    let slab = |low: [f64; 3], high: [f64; 3]| cuboid(low, high);
    // A bridge from one arm of a U to the other, all of whose corners are inside the U.
    let arms =
        [[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [8.0, 6.0], [8.0, 0.0], [12.0, 0.0], [12.0, 10.0], [0.0, 10.0]];
    let u = prism(&arms, 0.0, 10.0);
    for (soup, other) in [
        (cube(0.0, 10.0), slab([5.0; 3], [15.0; 3])),
        (cube(0.0, 10.0), slab([2.0, 2.0, 2.0], [4.0, 4.0, 11.0])),
        (u.clone(), slab([1.0, 1.0, 1.0], [11.0, 3.0, 3.0])),
        (u.clone(), slab([1.0, 1.0, 0.0], [11.0, 3.0, 10.0])),
        // In the notch of the U.
        (u, slab([5.0, 1.0, 1.0], [7.0, 3.0, 3.0])),
        (cube(0.0, 10.0), slab([12.0; 3], [13.0; 3])),
    ] {
        let good = joined(&[soup.clone(), other.clone()], &[false, false]);
        let (report, turned) = given(&joined(&[soup, other], &[false, true]));
        assert_eq!((report.inside_out.map(|found| found.pieces), report.cavities), (Some(1), 0));
        assert_eq!(turned, good);
    }
}

/// A prism over a polygon that runs counter-clockwise or clockwise, outward either way.
fn prism(outline: &[[f64; 2]], low: f64, high: f64) -> Soup {
    let count = outline.len();
    let corner = |i: usize, z: f64| [outline[i % count][0], outline[i % count][1], z];
    let mut soup = Soup::new();
    for i in 0..count {
        let [a, b, c, d] = [corner(i, low), corner(i + 1, low), corner(i + 1, high), corner(i, high)];
        soup.extend([[a, b, c], [a, c, d]]);
        if i > 0 && i + 1 < count {
            // Fans add up to the polygon, whatever its shape.
            soup.push([corner(0, low), corner(i + 1, low), corner(i, low)]);
            soup.push([corner(0, high), corner(i, high), corner(i + 1, high)]);
        }
    }
    let area: f64 = (0..count)
        .map(|i| corner(i, 0.0)[0] * corner(i + 1, 0.0)[1] - corner(i + 1, 0.0)[0] * corner(i, 0.0)[1])
        .sum();
    if area < 0.0 { reversed(soup) } else { soup }
}

#[test]
fn pieces_that_share_vertices_edges_and_faces_are_told_apart() {
    let one = cube(0.0, 10.0);
    let others = [
        // A vertex, an edge, a whole face, and the same box again.
        cube(10.0, 20.0),
        cuboid([10.0, 10.0, 0.0], [20.0, 20.0, 10.0]),
        cuboid([10.0, 0.0, 0.0], [20.0, 10.0, 10.0]),
        one.clone(),
    ];
    for (number, other) in others.iter().enumerate() {
        for inward in 0..4u8 {
            let inward = [0, 1].map(|piece| inward >> piece & 1 == 1);
            let file = joined(&[one.clone(), other.clone()], &inward);
            let (report, turned) = given(&file);
            let found = report.inside_out.map_or(0, |found| found.pieces);
            assert_eq!(report.pieces, 2, "{number}");
            assert_eq!(found, inward.iter().filter(|inward| **inward).count() as u64, "{number}");
            assert_eq!(turned, joined(&[one.clone(), other.clone()], &[false; 2]), "{number}");
            // The facets of both in turns, but where they cannot be told apart at all.
            if number < 2 {
                let mixed: Soup = (0..12).flat_map(|i| [file[i], file[12 + i]]).collect();
                let (report, turned) = given(&mixed);
                assert_eq!((report.pieces, report.inside_out.map_or(0, |found| found.pieces)), (2, found));
                let good = joined(&[one.clone(), other.clone()], &[false; 2]);
                assert_eq!(turned, (0..12).flat_map(|i| [good[i], good[12 + i]]).collect::<Soup>());
            }
        }
    }
}

#[test]
fn open_and_inconsistent_pieces_are_left_and_told() {
    let mut soup = cube(0.0, 10.0);
    soup.remove(3);
    soup = reversed(soup);
    soup.extend(reversed(cube(20.0, 30.0)));
    let (report, turned) = given(&soup);
    assert_eq!((report.pieces, report.open, report.inconsistent, report.turned_facets), (2, 1, 0, 12));
    assert_eq!(turned[..11], soup[..11]);
    let mut soup = cube(0.0, 10.0);
    soup[4].swap(0, 1);
    let (report, turned) = given(&soup);
    assert_eq!((report.pieces, report.open, report.inconsistent, report.turned_facets), (1, 0, 1, 0));
    assert_eq!(turned, soup);
    // Facets with equal corners are of no piece.
    soup = vec![[[1.0; 3]; 3], [[0.0; 3], [0.0; 3], [1.0; 3]]];
    assert_eq!(given(&soup), (PiecesReport::default(), soup));
}

#[test]
fn facets_are_made_consistent() {
    let good = joined(&[cube(0.0, 30.0), cube(10.0, 20.0), cube(25.0, 50.0)], &[false, true, false]);
    let mut soup = good.clone();
    for number in [1, 5, 14, 15, 26, 30, 31, 35] {
        soup[number].swap(0, 1);
    }
    let (report, turned) = sought(&soup);
    assert_eq!((report.pieces, report.inconsistent, report.open, report.cavities), (3, 0, 0, 1));
    assert_eq!(at(&turned, &[[5.0; 3], [15.0; 3], [28.0; 3], [40.0; 3]]), [1, 0, 2, 1]);
    assert_eq!(report.turned_facets, 8);
    // An open box is made consistent, by as few facets as there have to be.
    let mut open = cube(0.0, 10.0);
    open.truncate(10);
    let whole = open.clone();
    open[7].swap(0, 2);
    let (report, turned) = sought(&open);
    assert_eq!((report.pieces, report.open, report.turned_facets), (1, 1, 1));
    assert_eq!(turned[..7], whole[..7]);
    assert_eq!(given(&turned).0.inconsistent, 0);
}

#[test]
fn a_moebius_strip_stays_as_it_is() {
    let ring: Vec<[[f64; 3]; 2]> = (0..12)
        .map(|i| {
            let (angle, twist) =
                (f64::from(i) * std::f64::consts::PI / 6.0, f64::from(i) * std::f64::consts::PI / 12.0);
            [3.0, -3.0].map(|r| {
                let out = 10.0 + r * twist.cos();
                [out * angle.cos(), out * angle.sin(), r * twist.sin()]
            })
        })
        .collect();
    let mut soup = Soup::new();
    for i in 0..12 {
        let [a, b] = ring[i];
        // Half a turn later the sides have changed places.
        let [d, c] = if i == 11 { [ring[0][1], ring[0][0]] } else { ring[i + 1] };
        soup.extend([[a, b, c], [a, c, d]]);
    }
    let (report, turned) = sought(&soup);
    assert_eq!((report.pieces, report.inconsistent, report.turned_facets), (1, 1, 0));
    assert_eq!(turned, soup);
}

#[test]
fn too_little_memory_is_an_error() {
    let soup = cube(0.0, 1.0);
    let told = study(&[&soup], root(), Consistency::Given, 500, &Silent).unwrap_err().to_string();
    assert!(told.contains("12 facets") && told.contains("`memory`"), "{told}");
}

/// Whether a box lies in another.
fn is_in(inner: &[[f64; 3]; 2], outer: &[[f64; 3]; 2]) -> bool {
    inner != outer && (0..3).all(|a| outer[0][a] <= inner[0][a] && inner[1][a] <= outer[1][a])
}

fn box_volume(b: &[[f64; 3]; 2]) -> f64 {
    (0..3).map(|a| b[1][a] - b[0][a]).product()
}

/// Which of some boxes face inward in the end, by the rule, for one file.
fn by_the_rule(boxes: &[[[f64; 3]; 2]], inward: &[bool]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|&i, &j| box_volume(&boxes[j]).total_cmp(&box_volume(&boxes[i])));
    let outers = |i: usize| (0..boxes.len()).filter(move |&j| is_in(&boxes[i], &boxes[j]));
    let concerned = |i: usize| inward[i] || outers(i).any(|j| inward[j]);
    let outermost: Vec<bool> = (0..boxes.len())
        .filter(|&i| !concerned(i) || outers(i).next().is_none())
        .map(|i| inward[i])
        .collect();
    let is_inverted = 2 * outermost.iter().filter(|inward| **inward).count() > outermost.len();
    let mut cavity = vec![false; boxes.len()];
    for i in order {
        let field: i64 = outers(i).map(|j| if cavity[j] { -1 } else { 1 }).sum();
        let parent = outers(i).min_by(|&j, &k| box_volume(&boxes[j]).total_cmp(&box_volume(&boxes[k])));
        cavity[i] = field >= 1 && (inward[i] || is_inverted && parent.is_some_and(|j| inward[j]));
    }
    cavity
}

fn boxes() -> impl Strategy<Value = Vec<([[f64; 3]; 2], bool)>> {
    let side = (-12i32..12, 1i32..16).prop_map(|(low, size)| (f64::from(low), f64::from(low + size)));
    let one = (prop::array::uniform3(side), any::<bool>())
        .prop_map(|(sides, inward)| ([sides.map(|s| s.0), sides.map(|s| s.1)], inward));
    // Boxes of one volume are not told apart by it.
    prop::collection::vec(one, 1..14).prop_map(|mut boxes: Vec<([[f64; 3]; 2], bool)>| {
        boxes.sort_by(|a, b| box_volume(&a.0).total_cmp(&box_volume(&b.0)));
        boxes.dedup_by(|a, b| box_volume(&a.0) == box_volume(&b.0));
        boxes
    })
}

proptest! {
    #[test]
    fn boxes_are_turned_by_the_rule(boxes in boxes(), seed in any::<prop::sample::Index>()) {
        let mut boxes = boxes;
        let by = seed.index(boxes.len());
        boxes.rotate_left(by);
        let (places, inward): (Vec<_>, Vec<bool>) = boxes.into_iter().unzip();
        let soups: Vec<Soup> = places.iter().map(|[low, high]| cuboid(*low, *high)).collect();
        let (report, turned) = given(&joined(&soups, &inward));
        let expected = by_the_rule(&places, &inward);
        prop_assert_eq!(turned, joined(&soups, &expected));
        prop_assert_eq!(report.pieces as usize, soups.len());
        let found = report.inside_out.map_or(0, |found| found.pieces) as usize;
        let wrong = inward.iter().zip(&expected).filter(|(inward, cavity)| **inward && !**cavity).count();
        prop_assert_eq!(found, wrong);
    }

    #[test]
    fn piles_without_cavities_come_back(boxes in boxes(), flips in prop::collection::vec(any::<bool>(), 14 * 12)) {
        let mut kept: Vec<([[f64; 3]; 2], bool)> = Vec::new();
        for (place, inward) in boxes {
            if !kept.iter().any(|(other, _)| is_in(&place, other) || is_in(other, &place)) {
                kept.push((place, inward));
            }
        }
        let (places, inward): (Vec<_>, Vec<bool>) = kept.into_iter().unzip();
        let soups: Vec<Soup> = places.iter().map(|[low, high]| cuboid(*low, *high)).collect();
        let good = joined(&soups, &vec![false; soups.len()]);
        prop_assert_eq!(&given(&joined(&soups, &inward)).1, &good);
        // Any facets turned over, and not only whole boxes. Which way some corners come first is left to the facets.
        let mut soup = good.clone();
        soup.iter_mut().zip(flips).filter(|(_, flip)| *flip).for_each(|(facet, _)| facet.swap(1, 2));
        let (report, turned) = sought(&soup);
        prop_assert_eq!((report.pieces as usize, report.inconsistent, report.open), (soups.len(), 0, 0));
        prop_assert_eq!(turned, good);
    }

    #[test]
    fn threads_and_the_order_of_files_do_not_show(boxes in boxes()) {
        let file = |(place, inward): &([[f64; 3]; 2], bool)| {
            joined(&[cuboid(place[0], place[1])], &[*inward])
        };
        let files: Vec<Soup> = boxes.iter().map(file).collect();
        let mut backward: Vec<Soup> = files.iter().rev().cloned().collect();
        let (report, turned) = studied(&files, Consistency::Given);
        for threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (other, again) = pool.install(|| studied(&files, Consistency::Given));
            prop_assert_eq!((&other, &again), (&report, &turned));
        }
        let (other, mut again) = studied(&backward, Consistency::Given);
        again.reverse();
        backward.reverse();
        prop_assert_eq!(again, turned);
        let counts = |report: PiecesReport| (report.pieces, report.cavities, report.turned_facets);
        prop_assert_eq!(counts(other), counts(report));
    }
}

//! A small tree, given by a formula, for the tests of the store.

use super::{
    BeadRow, BeadSegment, BeadTables, BeadsMeta, BrickTree, BuildCounts, Compression, IdentityPlace,
    MemoryTree, Meta, Refine, Scratch, SectionRow, Shard, ShardId, ShardNumbers, Source, StoreWriter,
    cells_of, encode_segments, encode_with,
};
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples, SignChanges, point_position};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, Octant, RootCube};
use std::path::Path;

/// Metadata of the small tree.
pub fn meta(depth: u8) -> Meta {
    Meta {
        program: "brickfield 0.1.0".into(),
        sources: vec![Source {
            path: "parts/two boxes.stl".into(),
            bytes: 1284,
            facets: 24,
            format: "stl".into(),
            blake3: [7; 32],
        }],
        unit: "mm".into(),
        root: RootCube { origin: [-16.0, 0.0, 2.5], edge: 64.0 },
        bounds_min: [-15.0, 1.0, 3.5],
        bounds_max: [47.0, 63.0, 65.5],
        depth,
        refine: Refine::Hidden,
        stddev: 0.0,
        tolerance: None,
        numbers: BuildCounts { facets: 24, degenerate_facets: 0, nodes_per_level: vec![1, 8, 8] },
        beads: None,
        shard: None,
        volumes: None,
    }
}

/// Winding number at a lattice position: two boxes, the second counted 200 times, so that differences need 16
/// bits; a box beside them, and one around a single sample, whose nodes need 8.
pub fn count_at(units: [i32; 3]) -> i16 {
    let inside = |min: [i32; 3], max: [i32; 3]| (0..3).all(|a| (min[a]..max[a]).contains(&units[a]));
    let first = inside([1 << 20, 1 << 20, 1 << 20], [7 << 20, 5 << 20, 6 << 20]);
    let second = inside([5 << 20, 3 << 20, 2 << 20], [9 << 20, 7 << 20, 4 << 20]);
    let third = inside([13 << 20, 1 << 20, 1 << 20], [15 << 20, 3 << 20, 2 << 20]);
    let corner = [9 << 20, 5 << 20, 5 << 20];
    let single = inside(corner, corner.map(|c| c + (1 << 17)));
    i16::from(first) + 200 * i16::from(second) + i16::from(third) + i16::from(single)
}

/// The brick of a node by formula.
pub fn brick_at(key: NodeKey, leaf: bool) -> Brick {
    let mut samples = Samples::filled(0);
    for index in 0..POINTS {
        let ijk = point_position(index);
        let base = key.base();
        samples.0[index] = count_at([0, 1, 2].map(|a| base[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1));
    }
    let (min, max) = samples.range();
    if min == max {
        return Brick::Uniform(min);
    }
    let hermite = if leaf { hermite_of(&samples) } else { Hermite::default() };
    Brick::Counts { samples, hermite }
}

/// As many Hermite edges as the samples need, by formula.
fn hermite_of(samples: &Samples) -> Hermite {
    let mut hermite = Hermite::default();
    let counts = SignChanges::of(samples).counts();
    for axis in Axis::ALL {
        let mut normal = [0; 3];
        normal[axis.index()] = 1;
        let normal = OctNormal::from_integer(normal);
        let edge = |i| HermiteEdge { offset: (i / 32 * 257 + i % 2 * 7919) as u16, normal };
        hermite.edges[axis.index()] = (0..counts[axis.index()]).map(edge).collect();
    }
    hermite
}

/// Nodes of the small tree in key order: the root, its children, the children of child 1.
pub fn nodes() -> Vec<(NodeKey, bool)> {
    let children = |key: NodeKey| Octant::all().map(move |octant| key.child(octant));
    let divided = NodeKey::new(1, [1, 0, 0]).expect("a node");
    let mut nodes = vec![(NodeKey::ROOT, false)];
    nodes.extend(children(NodeKey::ROOT).map(|key| (key, key != divided)));
    nodes.extend(children(divided).map(|key| (key, true)));
    nodes
}

/// The small tree in memory.
pub fn tree() -> MemoryTree {
    let mut tree = MemoryTree::new(meta(2).root);
    for (key, leaf) in nodes() {
        tree.insert(key, leaf, brick_at(key, leaf));
    }
    tree
}

/// Writes the small tree, the children before their parents.
pub fn write(path: &Path) {
    let mut writer = StoreWriter::create(path, &meta(2)).expect("a writable directory");
    append_all(&mut writer);
    writer.finish(meta(2)).expect("a complete tree");
}

fn append_all(writer: &mut StoreWriter) {
    let tree = tree();
    let mut keys = tree.keys();
    keys.sort_by_key(|key| key.post_order());
    for key in keys {
        let leaf = tree.node(key).expect("its own key").leaf;
        writer.append_brick(key, leaf, &tree.brick(key).expect("its own key")).expect("room on the disk");
    }
}

/// Writes these bricks as the range coder has them.
pub fn write_coded(path: &Path, meta: Meta, bricks: impl Iterator<Item = (NodeKey, bool, Brick)>) {
    let mut writer = StoreWriter::create(path, &meta).expect("a writable directory");
    for (key, leaf, brick) in bricks {
        let mut bytes = Vec::new();
        let head = encode_with(&brick, Compression::Range, &mut Scratch::new(), &mut bytes);
        writer.append(key, leaf, head, &bytes).expect("room on the disk");
    }
    writer.finish(meta).expect("a complete tree");
}

/// Writes the small tree as the range coder has it.
pub fn write_range(path: &Path) {
    write_coded(path, meta(2), nodes().into_iter().map(|(key, leaf)| (key, leaf, brick_at(key, leaf))));
}

/// Writes the brick of 1/1024ths as the range coder has it.
pub fn write_range_fractions(path: &Path) {
    let meta = Meta { numbers: BuildCounts { nodes_per_level: vec![1], ..meta(0).numbers }, ..meta(0) };
    write_coded(path, meta, [(NodeKey::ROOT, true, fractions())].into_iter());
}

/// A brick of 1/1024ths by formula: a slope, bent along z, with jumps of a whole number and of −3 in x and y.
pub fn fractions() -> Brick {
    let mut samples = Samples::fractions(10);
    for (index, sample) in samples.0.iter_mut().enumerate() {
        let [x, y, z] = [0, 1, 2].map(|a| (index / BRICK_POINTS.pow(a) % BRICK_POINTS) as i16);
        *sample = 17 * x - 5 * y + z * z + 1024 * i16::from(x > 20) - 3072 * i16::from(y > 29);
    }
    let hermite = hermite_of(&samples);
    Brick::Counts { samples, hermite }
}

/// Writes a store of that brick alone.
pub fn write_fractions(path: &Path) {
    let meta = Meta { numbers: BuildCounts { nodes_per_level: vec![1], ..meta(0).numbers }, ..meta(0) };
    let mut writer = StoreWriter::create(path, &meta).expect("a writable directory");
    writer.append_brick(NodeKey::ROOT, true, &fractions()).expect("room on the disk");
    writer.finish(meta).expect("a complete tree");
}

/// Metadata of the small tree as one of beads.
pub fn meta_of_beads() -> Meta {
    let identity = Some(IdentityPlace::default());
    let beads = Some(BeadsMeta { section: "stadium".into(), beads: 2, segments: 3, identity, passes: None });
    Meta { beads, ..meta(2) }
}

/// Two beads.
pub fn tables() -> BeadTables {
    let bead = |feature, lines| BeadRow { source: 0, layer: 1, tool: 0, feature, lines };
    BeadTables {
        beads: vec![bead(0, (10, 12)), bead(1, (13, 13))],
        sections: vec![SectionRow { half_width: 1e5, half_height: 5e4, axis: [0.0, 0.0, 1.0] }],
        features: vec!["Perimeter".into(), "Solid infill".into()],
        passes: Vec::new(),
    }
}

/// Their segments, as two of the leaves list them.
pub fn lists() -> Vec<(NodeKey, Vec<BeadSegment>)> {
    let segment = |a, b, pass| BeadSegment { a, b, section: 0, pass, line: 0 };
    let turn = [6 << 20, 4 << 20, 3 << 20];
    let first = segment([2 << 20, 2 << 20, 3 << 20], turn, 0);
    let second = segment(turn, [7 << 20, 2, 3 << 20], 0);
    let other = segment([0, 5, (1 << 24) - 1], [3, 2, 1], 1);
    let leaf = |position| NodeKey::new(1, position).expect("a node");
    vec![(leaf([0, 0, 0]), vec![first, second, other]), (leaf([0, 0, 1]), vec![other])]
}

/// Appends them.
fn append_lists(writer: &mut StoreWriter) {
    append_lists_of(writer, tables(), lists());
}

fn append_lists_of(writer: &mut StoreWriter, tables: BeadTables, lists: Vec<(NodeKey, Vec<BeadSegment>)>) {
    let count = tables.count();
    writer.begin_identity(tables);
    for (key, list) in lists {
        let mut bytes = Vec::new();
        encode_segments(&list, count, &mut bytes);
        writer.append_identity(key, &bytes).expect("room on the disk");
    }
}

/// Metadata of the small tree as one of passes.
pub fn meta_of_passes() -> Meta {
    let meta = meta_of_beads();
    Meta { beads: meta.beads.map(|beads| BeadsMeta { passes: Some(3), ..beads }), ..meta }
}

/// The two beads, the first of which has two passes.
pub fn tables_of_passes() -> BeadTables {
    BeadTables { passes: vec![0, 2, 3], ..tables() }
}

/// Their segments with passes and lines.
pub fn lists_of_passes() -> Vec<(NodeKey, Vec<BeadSegment>)> {
    let mut lists = lists();
    for segment in lists.iter_mut().flat_map(|(_, list)| list) {
        (segment.pass, segment.line) = match (segment.pass, segment.b[0]) {
            (1, _) => (2, 13),
            (_, 0x70_0000) => (1, 12),
            _ => (0, 10),
        };
    }
    lists
}

/// Writes the small tree as one of passes.
pub fn write_passes(path: &Path) {
    let mut writer = StoreWriter::create(path, &meta_of_passes()).expect("a writable directory");
    append_all(&mut writer);
    append_lists_of(&mut writer, tables_of_passes(), lists_of_passes());
    writer.finish(meta_of_passes()).expect("a complete tree");
}

/// Writes the small tree as one of beads.
pub fn write_beads(path: &Path) {
    let mut writer = StoreWriter::create(path, &meta_of_beads()).expect("a writable directory");
    append_all(&mut writer);
    append_lists(&mut writer);
    writer.finish(meta_of_beads()).expect("a complete tree");
}

/// Metadata of the first of two shards of the small tree as one of beads: five of the root's children, the fourth of
/// which is empty.
pub fn meta_of_shard() -> Meta {
    let found =
        ShardNumbers { pieces: 0x0123_4567_89ab_cdef, joined: true, cells: (0, 5), empty: vec![(3, 0)] };
    let shard = Shard { id: ShardId { number: 1, of: 2 }, level: 1, gwn_error: 1e-3, found };
    Meta { shard: Some(shard), ..meta_of_beads() }
}

/// The nodes of that share, in key order.
pub fn nodes_of_shard() -> Vec<(NodeKey, bool)> {
    let cell = |key: NodeKey| cells_of(key, 1).start;
    let is_there = |key: NodeKey| key.level() > 0 && cell(key) < 5 && cell(key) != 3;
    nodes().into_iter().filter(|(key, _)| is_there(*key)).collect()
}

/// Writes that share.
pub fn write_shard(path: &Path) {
    let mut writer = StoreWriter::create(path, &meta_of_shard()).expect("a writable directory");
    for (key, leaf) in nodes_of_shard() {
        writer.append_brick(key, leaf, &brick_at(key, leaf)).expect("room on the disk");
    }
    append_lists(&mut writer);
    writer.finish(meta_of_shard()).expect("the nodes of the shard");
}

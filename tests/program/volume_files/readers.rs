//! Readers of the volumes that the program writes, for what it writes and no more.

use flate2::read::{GzDecoder, ZlibDecoder};
use std::io::Read;
use std::path::Path;

/// Samples of a cube, x fastest.
pub struct Samples {
    pub axis: usize,
    pub values: Vec<f32>,
}

impl Samples {
    fn filled(axis: usize, value: f32) -> Samples {
        Samples { axis, values: vec![value; axis.pow(3)] }
    }

    fn set(&mut self, [x, y, z]: [usize; 3], value: f32) {
        let axis = self.axis;
        if [x, y, z].iter().all(|&i| i < axis) {
            self.values[(z * axis + y) * axis + x] = value;
        } else {
            assert_eq!(value, 0.0, "a sample beyond the level");
        }
    }
}

/// Bytes that are taken from the front.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        let (front, rest) = self.0.split_at(count);
        self.0 = rest;
        front
    }

    fn u8(&mut self) -> u8 {
        self.take(1)[0]
    }

    fn u16(&mut self) -> usize {
        usize::from(u16::from_le_bytes(self.take(2).try_into().unwrap()))
    }

    fn u32(&mut self) -> usize {
        u32::from_le_bytes(self.take(4).try_into().unwrap()) as usize
    }

    fn i64(&mut self) -> i64 {
        i64::from_le_bytes(self.take(8).try_into().unwrap())
    }

    fn text(&mut self) -> String {
        let length = self.u32();
        String::from_utf8(self.take(length).to_vec()).unwrap()
    }
}

fn inflate(stream: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    ZlibDecoder::new(stream).read_to_end(&mut out).unwrap();
    out
}

/// Numbers of 16-bit integers or 32-bit floats.
pub fn numbers(bytes: &[u8], kind: &str) -> Vec<f32> {
    match kind {
        "i2" => bytes.chunks_exact(2).map(|b| f32::from(i16::from_le_bytes(b.try_into().unwrap()))).collect(),
        "f4" => bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect(),
        _ => panic!("{kind}"),
    }
}

/// A grid of an OpenVDB file: its name, type, and samples of a level of `axis` samples.
pub fn vdb(path: &Path, axes: &[usize]) -> Vec<(String, String, Samples)> {
    let all = std::fs::read(path).unwrap();
    let mut bytes = Bytes(&all);
    assert_eq!((bytes.i64(), bytes.u32()), (0x5644_4220, 224));
    bytes.take(8 + 1 + 36);
    metadata(&mut bytes);
    assert_eq!(bytes.u32(), axes.len());
    let mut grids = Vec::new();
    for &axis in axes {
        let (name, kind) = (bytes.text(), bytes.text());
        assert_eq!(bytes.text(), "");
        let [grid, voxels, end] = [bytes.i64(), bytes.i64(), bytes.i64()].map(|at| at as usize);
        let mut topology = Bytes(&all[grid..voxels]);
        assert_eq!(topology.u32(), 3);
        metadata(&mut topology);
        assert_eq!(topology.text(), "UniformScaleTranslateMap");
        topology.take(6 * 24);
        let mut tree = Tree {
            voxels: Bytes(&all[voxels..end]),
            is_float: kind.contains("float"),
            background: 0.0,
            samples: Samples::filled(axis, 0.0),
        };
        tree.read(&mut topology);
        assert!(topology.0.is_empty() && tree.voxels.0.is_empty());
        grids.push((name, kind, tree.samples));
        bytes = Bytes(&all[end..]);
    }
    assert!(bytes.0.is_empty());
    grids
}

fn metadata(bytes: &mut Bytes<'_>) {
    for _ in 0..bytes.u32() {
        bytes.text();
        assert_eq!(bytes.text(), "string");
        bytes.text();
    }
}

struct Tree<'a> {
    voxels: Bytes<'a>,
    is_float: bool,
    background: f32,
    samples: Samples,
}

/// Values of the active entries of a node, and what the others are.
struct Values {
    active: Vec<f32>,
    /// Whether all inactive entries are inside of a level set.
    all_inner: bool,
    /// Entries that are not inside.
    outer: Option<Vec<usize>>,
}

fn bits(mask: &[u8]) -> Vec<usize> {
    (0..8 * mask.len()).filter(|n| mask[n / 8] >> (n % 8) & 1 == 1).collect()
}

/// Place of an entry of a node of `2^log` an axis.
fn place(n: usize, log: usize) -> [usize; 3] {
    let low = (1 << log) - 1;
    [n >> (2 * log), n >> log & low, n & low]
}

fn plus(a: [usize; 3], b: [usize; 3], scale: usize) -> [usize; 3] {
    std::array::from_fn(|n| a[n] + b[n] * scale)
}

impl Tree<'_> {
    fn values(&self, bytes: &mut Bytes<'_>, count: usize, mask_bytes: usize) -> Values {
        let code = bytes.u8();
        assert!([0, 1, 3].contains(&code));
        let outer = (code == 3).then(|| bits(bytes.take(mask_bytes)));
        let length = bytes.i64();
        let raw = if length > 0 {
            inflate(bytes.take(length as usize))
        } else {
            bytes.take(length.unsigned_abs() as usize).to_vec()
        };
        assert_eq!(raw.len(), 4 * count);
        let number =
            |b: [u8; 4]| if self.is_float { f32::from_le_bytes(b) } else { i32::from_le_bytes(b) as f32 };
        let active = raw.chunks_exact(4).map(|b| number(b.try_into().unwrap())).collect();
        Values { active, all_inner: code == 1, outer }
    }

    /// Fills the entries of a node, but for its children.
    fn entries(
        &mut self,
        values: Values,
        [corner, log, edge]: [[usize; 3]; 3],
        [active, children]: [&[usize]; 2],
    ) {
        let (log, edge) = (log[0], edge[0]);
        for (n, value) in active.iter().zip(values.active) {
            assert_ne!(value, self.background, "the background is not active");
            self.fill(plus(corner, place(*n, log), edge), edge, value);
        }
        for n in 0..1 << (3 * log) {
            let is_outer =
                values.outer.as_ref().map_or(!values.all_inner, |outer| outer.binary_search(&n).is_ok());
            if !is_outer && active.binary_search(&n).is_err() && children.binary_search(&n).is_err() {
                self.fill(plus(corner, place(n, log), edge), edge, -self.background);
            }
        }
    }

    fn read(&mut self, topology: &mut Bytes<'_>) {
        assert_eq!(topology.u32(), 1);
        let background = topology.u32() as u32;
        self.background = if self.is_float { f32::from_bits(background) } else { background as f32 };
        self.samples.values.fill(self.background);
        assert_eq!(topology.u32(), 0);
        for _ in 0..topology.u32() {
            let origin = std::array::from_fn(|_| topology.u32());
            let (children, tiles) = (bits(topology.take(4096)), bits(topology.take(4096)));
            let values = self.values(topology, tiles.len(), 4096);
            self.entries(values, [origin, [5; 3], [128; 3]], [&tiles, &children]);
            let mut leaves = Vec::new();
            for n in children {
                let corner = plus(origin, place(n, 5), 128);
                let (children, tiles) = (bits(topology.take(512)), bits(topology.take(512)));
                let values = self.values(topology, tiles.len(), 512);
                self.entries(values, [corner, [4; 3], [8; 3]], [&tiles, &children]);
                leaves
                    .extend(children.into_iter().map(|n| (plus(corner, place(n, 4), 8), topology.take(64))));
            }
            for (corner, mask) in leaves {
                assert_eq!(self.voxels.take(64), mask);
                let active = bits(mask);
                let mut voxels = std::mem::replace(&mut self.voxels, Bytes(&[]));
                let values = self.values(&mut voxels, active.len(), 64);
                self.voxels = voxels;
                self.entries(values, [corner, [3; 3], [1; 3]], [&active, &[]]);
            }
        }
    }

    fn fill(&mut self, corner: [usize; 3], edge: usize, value: f32) {
        for n in 0..edge.pow(3) {
            self.samples.set(plus(corner, [n % edge, n / edge % edge, n / edge / edge], 1), value);
        }
    }
}

/// Samples of a VTK image.
pub fn vti(path: &Path, axis: usize, kind: &str) -> Samples {
    let all = std::fs::read(path).unwrap();
    let mark = b"<AppendedData encoding=\"raw\">\n_";
    let start = all.windows(mark.len()).position(|bytes| bytes == mark).unwrap() + mark.len();
    let mut bytes = Bytes(&all[start..]);
    let (blocks, _, last) = (bytes.i64(), bytes.i64(), bytes.i64());
    assert_eq!(last, 0);
    let sizes = (0..blocks).map(|_| bytes.i64() as usize).collect::<Vec<_>>();
    let raw = sizes.iter().flat_map(|&size| inflate(bytes.take(size))).collect::<Vec<u8>>();
    assert!(bytes.0.starts_with(b"\n</AppendedData>"));
    Samples { axis, values: numbers(&raw, kind) }
}

/// Samples of an array of an OME-Zarr folder.
pub fn zarr(folder: &Path, axis: usize, kind: &str) -> Samples {
    let text = std::fs::read_to_string(folder.join("zarr.json")).unwrap();
    let array: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut samples = Samples::filled(axis, array["fill_value"].as_f64().unwrap() as f32);
    let shard = axis.min(256);
    let (shards, bricks) = (axis / shard, shard / 32);
    for n in 0..shards.pow(3) {
        let [x, y, z] = [n % shards, n / shards % shards, n / shards / shards];
        let Ok(all) = std::fs::read(folder.join(format!("c/{z}/{y}/{x}"))) else { continue };
        let index = all.len() - 4 - 16 * bricks.pow(3);
        let mut entries = Bytes(&all[index..]);
        for brick in 0..bricks.pow(3) {
            let (at, length) = (entries.i64(), entries.i64());
            if at == -1 {
                continue;
            }
            let mut raw = Vec::new();
            GzDecoder::new(&all[at as usize..][..length as usize]).read_to_end(&mut raw).unwrap();
            let within = [brick % bricks, brick / bricks % bricks, brick / bricks / bricks];
            let corner = plus(plus([0; 3], [x, y, z], shard), within, 32);
            for (n, value) in numbers(&raw, kind).into_iter().enumerate() {
                samples.set(plus(corner, [n % 32, n / 32 % 32, n / 1024], 1), value);
            }
        }
    }
    samples
}

/// Blocks of a level of a VTKHDF file: the first cell of each, its 33³ points and its 32³ cells.
pub fn vtkhdf(path: &Path, level: usize, kind: &str) -> Vec<([usize; 3], Vec<f32>, Vec<f32>)> {
    let file = Hdf5(std::fs::read(path).unwrap());
    let root = u64::from_le_bytes(file.0[36..44].try_into().unwrap());
    let level = file.member(file.member(root, "VTKHDF"), &format!("Level{level}"));
    let boxes = file.array(file.member(level, "AMRBox"));
    let corners = boxes
        .chunks_exact(24)
        .map(|b| [0, 8, 16].map(|at| u32::from_le_bytes(b[at..at + 4].try_into().unwrap()) as usize));
    let [points, cells] = [("PointData", kind), ("CellData", "f4")]
        .map(|(name, kind)| numbers(&file.array(file.member(file.member(level, name), "w")), kind));
    let blocks = corners.zip(points.chunks_exact(33 * 33 * 33).zip(cells.chunks_exact(32 * 32 * 32)));
    blocks.map(|(corner, (points, cells))| (corner, points.to_vec(), cells.to_vec())).collect()
}

struct Hdf5(Vec<u8>);

impl Hdf5 {
    /// The messages of an object by their types.
    fn messages(&self, at: u64) -> Vec<(u8, &[u8])> {
        let mut bytes = Bytes(&self.0[at as usize..]);
        assert_eq!(bytes.take(6), b"OHDR\x02\x02");
        let length = bytes.u32();
        let mut bytes = Bytes(bytes.take(length));
        let mut messages = Vec::new();
        while !bytes.0.is_empty() {
            let (kind, length) = (bytes.u8(), bytes.u16());
            bytes.u8();
            messages.push((kind, bytes.take(length)));
        }
        messages
    }

    fn member(&self, group: u64, name: &str) -> u64 {
        let found = self.messages(group).into_iter().find_map(|(kind, data)| {
            let is_it = kind == 6 && &data[3..data.len() - 8] == name.as_bytes();
            is_it.then(|| u64::from_le_bytes(data[data.len() - 8..].try_into().unwrap()))
        });
        found.unwrap_or_else(|| panic!("no member {name}"))
    }

    /// The bytes of an array; what chunks leave out is 0.
    fn array(&self, at: u64) -> Vec<u8> {
        let messages = self.messages(at);
        let of = |wanted: u8| messages.iter().find(|(kind, _)| *kind == wanted).unwrap().1;
        let mut space = Bytes(&of(1)[4..]);
        let mut count = 1;
        while !space.0.is_empty() {
            count *= space.i64() as usize;
        }
        let mut layout = Bytes(&of(8)[1..]);
        let size = u32::from_le_bytes(of(3)[4..8].try_into().unwrap()) as usize;
        if layout.u8() == 1 {
            let (at, length) = (layout.i64() as usize, layout.i64() as usize);
            assert_eq!(length, count * size);
            return self.0[at..at + length].to_vec();
        }
        layout.u8();
        let (tree, chunk) = (layout.i64(), layout.u32());
        let mut out = vec![0; count * size];
        if tree != -1 {
            self.chunks(tree as usize, size, chunk, &mut out);
        }
        out
    }

    fn chunks(&self, at: usize, size: usize, chunk: usize, out: &mut [u8]) {
        let mut node = Bytes(&self.0[at..]);
        assert_eq!(node.take(5), b"TREE\x01");
        let (level, used) = (node.u8(), node.u16());
        node.take(16);
        for _ in 0..used {
            let (bytes, _) = (node.u32(), node.u32());
            let first = node.i64() as usize;
            node.i64();
            let child = node.i64() as usize;
            if level > 0 {
                self.chunks(child, size, chunk, out);
                continue;
            }
            let raw = inflate(&self.0[child..child + bytes]);
            for n in 0..chunk {
                for byte in 0..size {
                    out[(first + n) * size + byte] = raw[byte * chunk + n];
                }
            }
        }
    }
}

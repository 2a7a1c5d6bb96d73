//! Integer fields on the lattice and trees over them.

use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples, SignChanges, point_position};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, Octant, RootCube, Units};
use crate::store::MemoryTree;

/// A field to sample, in units counted from the root's first sample.
pub trait SampledField: Sync {
    fn winding(&self, at: Units) -> i16;
    /// Offset and normal of the crossing between two samples, the first inside or the second.
    fn crossing(&self, low: Units, high: Units) -> ([f64; 3], f64);
}

/// The root cube of all tests: one world length per 2^20 units, not at the origin.
pub fn root() -> RootCube {
    RootCube { origin: [-8.0, -8.0, -8.0], edge: 16.0 }
}

/// World coordinates of a position counted from the root's first sample.
pub fn world(at: [f64; 3]) -> [f64; 3] {
    root().to_world(at.map(|c| c + 1.0))
}

/// Where `f(p) < 0` the winding number is 1; crossings by bisection, normals by differences.
pub struct ImplicitField<F>(pub F);

impl<F: Fn([f64; 3]) -> f64 + Sync> SampledField for ImplicitField<F> {
    fn winding(&self, at: Units) -> i16 {
        i16::from(self.0(world(at.map(f64::from))) < 0.0)
    }

    fn crossing(&self, low: Units, high: Units) -> ([f64; 3], f64) {
        let (a, b) = (world(low.map(f64::from)), world(high.map(f64::from)));
        let at = |t: f64| -> [f64; 3] { std::array::from_fn(|n| a[n] + (b[n] - a[n]) * t) };
        let starts = self.0(a) < 0.0;
        let (mut t0, mut t1) = (0.0, 1.0);
        for _ in 0..40 {
            let t = 0.5 * (t0 + t1);
            if (self.0(at(t)) < 0.0) == starts { t0 = t } else { t1 = t }
        }
        let p = at(t0);
        let step = 1e-6;
        let normal = std::array::from_fn(|n| {
            let (mut q, mut r) = (p, p);
            q[n] += step;
            r[n] -= step;
            self.0(q) - self.0(r)
        });
        (normal, t0)
    }
}

/// Several implicit shapes, each counting one.
pub struct Overlap<A, B>(pub A, pub B);

impl<A: SampledField, B: SampledField> SampledField for Overlap<A, B> {
    fn winding(&self, at: Units) -> i16 {
        self.0.winding(at) + self.1.winding(at)
    }

    fn crossing(&self, low: Units, high: Units) -> ([f64; 3], f64) {
        if self.0.winding(low) != self.0.winding(high) {
            self.0.crossing(low, high)
        } else {
            self.1.crossing(low, high)
        }
    }
}

/// Mixes bits (splitmix64).
pub fn hash(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Random signs, offsets and normals within boxes; a sphere or nothing elsewhere.
pub struct NoiseField {
    pub seed: u64,
    /// Lower and upper corners in units.
    pub boxes: Vec<[Units; 2]>,
    /// Share of inside samples, of 256.
    pub density: u64,
    /// Radius in world units of a sphere about the root's centre that is solid outside the boxes.
    pub radius: f64,
    /// Positions that are multiples of two to this power along all axes are not noisy: what only finer
    /// lattices see.
    pub quiet_bits: u32,
}

impl NoiseField {
    fn random(&self, at: Units, salt: u64) -> u64 {
        at.iter().fold(hash(self.seed ^ salt << 32), |h, &c| hash(h ^ c as u64))
    }
}

impl SampledField for NoiseField {
    fn winding(&self, at: Units) -> i16 {
        if at.iter().any(|&c| c <= 0 || c >= 1 << 24) {
            return 0;
        }
        let is_quiet = at.iter().all(|c| c & ((1 << self.quiet_bits) - 1) == 0);
        if !is_quiet
            && self.boxes.iter().any(|[low, high]| (0..3).all(|a| at[a] >= low[a] && at[a] <= high[a]))
        {
            return i16::from(self.random(at, 0) & 255 < self.density);
        }
        let p = world(at.map(f64::from));
        i16::from(p.iter().map(|c| c * c).sum::<f64>() < self.radius * self.radius)
    }

    fn crossing(&self, low: Units, high: Units) -> ([f64; 3], f64) {
        let salt = high.iter().zip(low).map(|(h, l)| (h - l) as u64).sum::<u64>();
        let normal = [1, 2, 3].map(|n| (self.random(low, salt ^ n) & 0xffff) as f64 - 32768.0);
        (normal, (self.random(low, salt ^ 4) & 0xffff) as f64 / 65536.0)
    }
}

/// Samples a node.
pub fn brick(shape: &dyn SampledField, key: NodeKey, leaf: bool) -> Brick {
    let (base, bits) = (key.base(), key.spacing_bits());
    let at = |ijk: [usize; 3]| -> Units { std::array::from_fn(|a| base[a] + ((ijk[a] as i32) << bits)) };
    let mut samples = Samples::filled(0);
    for index in 0..POINTS {
        let ijk = point_position(index);
        samples.0[index] = shape.winding(at(ijk));
    }
    let (min, max) = samples.range();
    if min == max {
        return Brick::Uniform(min);
    }
    let mut hermite = Hermite::default();
    let signs = SignChanges::of(&samples);
    for axis in Axis::ALL.into_iter().filter(|_| leaf) {
        for (k, j) in (0..BRICK_POINTS).flat_map(|k| (0..BRICK_POINTS).map(move |j| (k, j))) {
            for i in (0..BRICK_POINTS).filter(|i| signs.edges(axis, j, k) >> i & 1 == 1) {
                let mut high = [i, j, k];
                high[axis.index()] += 1;
                let (normal, t) = shape.crossing(at([i, j, k]), at(high));
                let largest = normal.iter().fold(1e-300f64, |m, n| m.max(n.abs()));
                let normal = OctNormal::from_integer(normal.map(|n| (n / largest * 1e9) as i64));
                let offset = (t * 65536.0).min(65535.0) as u16;
                hermite.edges[axis.index()].push(HermiteEdge { offset, normal });
            }
        }
    }
    Brick::Counts { samples, hermite }
}

/// A tree whose nodes are divided where `divide` says so.
pub fn tree(shape: &dyn SampledField, divide: &dyn Fn(NodeKey) -> bool) -> MemoryTree {
    tree_at(root(), shape, divide)
}

/// The same elsewhere in the world, which a shape that asks for the world does not know.
pub fn tree_at(root: RootCube, shape: &dyn SampledField, divide: &dyn Fn(NodeKey) -> bool) -> MemoryTree {
    let mut tree = MemoryTree::new(root);
    let mut open = vec![NodeKey::ROOT];
    while let Some(key) = open.pop() {
        let leaf = !divide(key);
        tree.insert(key, leaf, brick(shape, key, leaf));
        if !leaf {
            open.extend(Octant::all().map(|octant| key.child(octant)));
        }
    }
    tree
}

/// Divides at random: nodes of level `levels.0 - 1` and above always, below down to `levels.1` with the
/// chance `share` of 256.
pub fn random_divide(seed: u64, levels: (u8, u8), share: u64) -> impl Fn(NodeKey) -> bool {
    move |key| {
        key.level() < levels.0 || (key.level() < levels.1 && hash(seed ^ hash(key.code())) & 255 < share)
    }
}

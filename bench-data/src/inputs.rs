//! What the benchmarks read: every input by name, how it is made, and the hash of its bytes.
//!
//! [`Spec::write`] makes those that need nothing but this crate. [`Recipe::Swept`] is for whoever has a program that
//! sweeps toolpaths; its hash tells whether that program still makes the triangles that figures were told of.

use crate::pile::{bead_pile, sharp_part};
use crate::trig::sin_cos;
use crate::write::StlWriter;
use crate::{Mesh, Rng};
use std::f64::consts::TAU;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

/// One input of the benchmarks.
#[derive(Debug)]
pub struct Spec {
    /// Its file's name.
    pub name: &'static str,
    /// How it is made.
    pub recipe: Recipe,
    /// FNV-1a of its bytes.
    pub hash: u64,
}

/// How an input is made.
#[derive(Debug)]
pub enum Recipe {
    /// The bead pile of seed 1 with so many facets in [`PILE_SIZE`].
    Pile(u64),
    /// A toolpath swept with a stadium section of so many sides, without options, and the facets that come of it.
    Swept(&'static SampleToolpath, u32, u64),
    /// What is left of another input, a binary STL, when 3 of 100 facets are lost at random: cracks everywhere.
    Cracked(&'static Spec),
    /// The sharp part of seed 1 and how many facets it has.
    Part(u64),
    /// So many points `x,y,z` a line, at random in the box of the pile and a little around it.
    Points(u64),
    /// So many points with normals, `x y z nx ny nz` a line, scattered over a torus of radii 10 and 4.
    Torus(u64),
}

/// A toolpath that comes with this crate.
#[derive(Debug)]
pub struct SampleToolpath {
    /// Its file's name.
    pub name: &'static str,
    /// The file, compressed by xz.
    pub bytes: &'static [u8],
}

macro_rules! toolpath {
    ($name:literal) => {
        SampleToolpath { name: $name, bytes: include_bytes!(concat!("../gcode/", $name)) }
    };
}

/// 21,497 segments: a figure of 40 mm, two extruders.
pub static SPOT_TWO_TOOLS: SampleToolpath = toolpath!("spot40_2tool_prusaslicer.gcode.xz");
/// 32,261 segments: the same figure, one extruder.
pub static SPOT: SampleToolpath = toolpath!("spot40_relE_prusaslicer.gcode.xz");
/// 135,487 segments: four lobes of 63.5 mm.
pub static CLOVER: SampleToolpath = toolpath!("clover_cura.gcode.xz");

/// Sides of the box that piles fill, mm.
pub const PILE_SIZE: [f64; 3] = [100.0, 100.0, 12.0];

macro_rules! specs {
    ($($(#[$doc:meta])* $id:ident = $name:literal, $recipe:expr, $hash:literal;)*) => {
        $($(#[$doc])* pub static $id: Spec = Spec { name: $name, recipe: $recipe, hash: $hash };)*
        /// All of them.
        pub static ALL: &[&Spec] = &[$(&$id),*];
    };
}

specs! {
    /// 5,000 facets.
    PILE_5K = "pile-5k.stl", Recipe::Pile(5_000), 0x34856781d6eaf9fb;
    /// 50,000 facets.
    PILE_50K = "pile-50k.stl", Recipe::Pile(50_000), 0x03b72e6c95a1eb3c;
    /// 200,000 facets.
    PILE_200K = "pile-200k.stl", Recipe::Pile(200_000), 0x612adb332a5cfa38;
    /// 400,000 facets.
    PILE_400K = "pile-400k.stl", Recipe::Pile(400_000), 0xe1aa0f2d5a7dd847;
    /// 500,000 facets.
    PILE_500K = "pile-500k.stl", Recipe::Pile(500_000), 0x06d165c3d9207783;
    /// 1,000,000 facets.
    PILE_1M = "pile-1m.stl", Recipe::Pile(1_000_000), 0xf3fc3b2c0f5a8e34;
    /// 2,000,000 facets.
    PILE_2M = "pile-2m.stl", Recipe::Pile(2_000_000), 0x8a991cc116889727;
    /// 5,000,000 facets.
    PILE_5M = "pile-5m.stl", Recipe::Pile(5_000_000), 0x27a82d8ac033e69c;
    /// 10,000,000 facets.
    PILE_10M = "pile-10m.stl", Recipe::Pile(10_000_000), 0x7ad27e17f44a2ce7;
    /// 20,000,000 facets.
    PILE_20M = "pile-20m.stl", Recipe::Pile(20_000_000), 0x2b93bb16385c213d;
    /// 45,000,000 facets, 2.25 GB.
    PILE_45M = "pile-45m.stl", Recipe::Pile(45_000_000), 0xf4812033cd0a9db1;
    /// 909,020 facets, 45 MB.
    SPOT_0_9M = "spot-0.9m.stl", Recipe::Swept(&SPOT_TWO_TOOLS, 14, 909_020), 0xb214b345b8889e0b;
    /// 3,966,720 facets, 198 MB.
    SPOT_4M = "spot-4m.stl", Recipe::Swept(&SPOT, 24, 3_966_720), 0xbdc080bac2ceb131;
    /// 3,402,980 facets, 170 MB.
    CLOVER_3M = "clover-3m.stl", Recipe::Swept(&CLOVER, 10, 3_402_980), 0x951f657dd843a850;
    /// 50,000 facets less 3 of 100.
    CRACKED_50K = "cracked-50k.stl", Recipe::Cracked(&PILE_50K), 0x10a77bc001d00efa;
    /// A million facets less 3 of 100.
    CRACKED_1M = "cracked-1m.stl", Recipe::Cracked(&PILE_1M), 0xabe10ac958620484;
    /// 909,020 facets less 3 of 100.
    CRACKED_SPOT_0_9M = "cracked-spot-0.9m.stl", Recipe::Cracked(&SPOT_0_9M), 0xeafcd1c4f5f9eeae;
    /// 3,966,720 facets less 3 of 100.
    CRACKED_SPOT_4M = "cracked-spot-4m.stl", Recipe::Cracked(&SPOT_4M), 0xfbbf6fac421f6f59;
    /// 3,402,980 facets less 3 of 100.
    CRACKED_CLOVER_3M = "cracked-clover-3m.stl", Recipe::Cracked(&CLOVER_3M), 0x4bed048b42e7f11e;
    /// 45,000,000 facets less 3 of 100.
    CRACKED_45M = "cracked-45m.stl", Recipe::Cracked(&PILE_45M), 0xafd986660d039bce;
    /// A block with 56 bosses and 40 pockets.
    PART = "part.stl", Recipe::Part(9_448), 0xf3846dfa989db447;
    /// A cloud of two thousand points.
    TORUS_2K = "torus-2k.xyz", Recipe::Torus(2_000), 0xa49fd8e33146c0c3;
    /// A cloud of twenty thousand points.
    TORUS_20K = "torus-20k.xyz", Recipe::Torus(20_000), 0x8ba758dc0fe1f6ea;
}

impl Spec {
    /// What it is made from and has to be made first.
    pub fn base(&self) -> Option<&'static Spec> {
        match self.recipe {
            Recipe::Cracked(base) => Some(base),
            _ => None,
        }
    }

    /// The most bytes that its file has.
    pub fn bytes_max(&self) -> u64 {
        let stl = |facets: u64| STL_HEAD as u64 + STL_FACET as u64 * facets;
        match self.recipe {
            Recipe::Pile(facets) | Recipe::Swept(_, _, facets) | Recipe::Part(facets) => stl(facets),
            Recipe::Cracked(base) => base.bytes_max(),
            // Three and six numbers of at most 24 digits and a mark behind each.
            Recipe::Points(count) => 75 * count,
            Recipe::Torus(count) => 150 * count,
        }
    }

    /// Writes the input. `base` is the file of [`Spec::base`].
    ///
    /// # Errors
    /// If `out` fails, the file of the base cannot be read, or the input is [`Recipe::Swept`].
    pub fn write(&self, base: Option<&Path>, mut out: impl Write) -> io::Result<()> {
        match self.recipe {
            Recipe::Pile(facets) => {
                let pile = bead_pile(1, facets, PILE_SIZE);
                let mut stl = StlWriter::new(&mut out, pile.triangles())?;
                pile.into_iter().try_for_each(|bead| stl.mesh(&bead))?;
                stl.finish().map(drop)
            }
            Recipe::Part(facets) => {
                let mut stl = StlWriter::new(&mut out, facets)?;
                stl.mesh(&Mesh::merged(&sharp_part(1)))?;
                stl.finish().map(drop)
            }
            Recipe::Swept(..) => Err(io::Error::other("toolpaths are swept elsewhere")),
            Recipe::Cracked(_) => {
                let base = base.ok_or_else(|| io::Error::other("what is to be cracked is missing"))?;
                crack(base, out)
            }
            Recipe::Points(count) => {
                let [x, y, z] = PILE_SIZE;
                let mut rng = Rng::new(1);
                (0..count).try_for_each(|_| {
                    let [x, y, z] = [x, y, z].map(|side| rng.range(-0.02 * side, 1.02 * side));
                    writeln!(out, "{x},{y},{z}")
                })
            }
            Recipe::Torus(count) => torus(count, out),
        }
    }
}

/// Bytes before the first facet of a binary STL, and of each facet.
const STL_HEAD: usize = 84;
const STL_FACET: usize = 50;

/// Copies a binary STL without 3 of 100 facets.
fn crack(base: &Path, mut out: impl Write) -> io::Result<()> {
    let mut file = BufReader::with_capacity(1 << 20, File::open(base)?);
    let mut head = [0; STL_HEAD];
    file.read_exact(&mut head)?;
    let count = u32::from_le_bytes([head[80], head[81], head[82], head[83]]);
    let keeps = |rng: &mut Rng| rng.below(100) >= 3;
    let mut rng = Rng::new(1);
    let kept = (0..count).filter(|_| keeps(&mut rng)).count() as u32;
    head[80..].copy_from_slice(&kept.to_le_bytes());
    out.write_all(&head)?;
    let mut rng = Rng::new(1);
    let mut facet = [0; STL_FACET];
    for _ in 0..count {
        file.read_exact(&mut facet)?;
        if keeps(&mut rng) {
            out.write_all(&facet)?;
        }
    }
    Ok(())
}

/// Points of a torus with their normals.
fn torus(count: u64, mut out: impl Write) -> io::Result<()> {
    for ([x, y, z], [nx, ny, nz]) in torus_points(1).take(count as usize) {
        writeln!(out, "{x} {y} {z} {nx} {ny} {nz}")?;
    }
    Ok(())
}

/// Random points of a torus with radii of 10 and 4, evenly by area, with their outward normals: the outer side is longer, so
/// points on the inner one are dropped in proportion.
pub fn torus_points(seed: u64) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
    let (ring, tube) = (10.0, 4.0);
    let mut rng = Rng::new(seed);
    std::iter::from_fn(move || {
        loop {
            let (around, across) = (rng.range(0.0, TAU), rng.range(0.0, TAU));
            let (side, up) = cos_sin(across);
            if rng.range(0.0, ring + tube) > ring + tube * side {
                continue;
            }
            let (x, y) = cos_sin(around);
            let radius = ring + tube * side;
            return Some(([radius * x, radius * y, tube * up], [side * x, side * y, up]));
        }
    })
}

/// Cosine and sine.
fn cos_sin(angle: f64) -> (f64, f64) {
    let (sin, cos) = sin_cos(angle);
    (cos, sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::write::HashingWriter;

    #[test]
    fn the_small_ones_have_their_hashes() {
        let folder = tempfile::tempdir().unwrap();
        for spec in [&PILE_50K, &CRACKED_50K, &PART, &TORUS_2K] {
            let base = spec.base().map(|base| folder.path().join(base.name));
            let mut out = HashingWriter::new(File::create(folder.path().join(spec.name)).unwrap());
            spec.write(base.as_deref(), io::BufWriter::new(&mut out)).unwrap();
            assert_eq!(out.hash(), spec.hash, "{}", spec.name);
            assert!(out.bytes() <= spec.bytes_max(), "{}", spec.name);
        }
        assert!(SPOT_4M.write(None, io::sink()).is_err() && CRACKED_50K.write(None, io::sink()).is_err());
    }

    #[test]
    fn cracks_open_three_in_a_hundred() {
        let bytes = |facets: usize| STL_HEAD + facets * STL_FACET;
        let folder = tempfile::tempdir().unwrap();
        let (whole, mut cracked) = (folder.path().join("whole.stl"), Vec::new());
        PILE_50K.write(None, File::create(&whole).unwrap()).unwrap();
        CRACKED_50K.write(Some(&whole), &mut cracked).unwrap();
        let kept = u32::from_le_bytes(cracked[80..84].try_into().unwrap()) as usize;
        assert_eq!(cracked.len(), bytes(kept));
        assert!((48_300..48_700).contains(&kept), "{kept}");
    }
}

//! Figures of a store as splats: bits of positions and of all, error of normals, rates. `measure_splats PART.brf`
//!
//! Rates are of one thread.

use brickfield_coding::bsp::{NodeCells, SplatInput, SplatTree};
use brickfield_coding::range::{Bit, Coder, Decoder};
use brickfield_core::Silent;
use brickfield_core::lattice::NodeKey;
use brickfield_octree::store::Store;
use brickfield_splats::splats::{LevelsOptions, SplatLevels, bsp_bytes};
use std::time::Instant;

/// Counts the bits of decisions that are mixed: those on whether cells have splats.
struct Counting<'a> {
    decoder: Decoder<'a>,
    bits: f64,
    decisions: u64,
}

impl Coder for Counting<'_> {
    const ENCODES: bool = false;

    fn bit(&mut self, bit: &mut Bit, value: bool) -> bool {
        self.decoder.bit(bit, value)
    }

    fn given(&mut self, one: u32, value: bool) -> bool {
        let value = self.decoder.given(one, value);
        let share = f64::from(if value { one } else { 65_536 - one }) / 65_536.0;
        self.bits -= share.log2();
        self.decisions += 1;
        value
    }

    fn raw(&mut self, value: u32, bits: u32) -> u32 {
        self.decoder.raw(value, bits)
    }

    fn refuse(&mut self) {
        self.decoder.refuse();
    }
}

fn main() {
    let path = std::env::args().nth(1).expect("PART.brf");
    let store = Store::open(path.as_ref(), 512 << 20).expect("a store");
    let began = Instant::now();
    let levels = SplatLevels::new(&store, LevelsOptions::default(), &Silent).expect("splats");
    println!("splats of all levels: {:.2} s", began.elapsed().as_secs_f64());
    let began = Instant::now();
    let (bytes, summary) = bsp_bytes(&levels, "mm", [[0.0; 3], [1.0; 3]], &Silent).expect("a file");
    println!(
        "coded: {:.2} s, {} splats, {} bytes",
        began.elapsed().as_secs_f64(),
        summary.splats,
        bytes.len()
    );
    let mut tree = SplatTree::open(&bytes).expect("a head");
    let (mut bits, mut seconds, mut splats, mut decisions) = (0.0, 0.0, 0u64, 0);
    for unit in 0..tree.entries().len() {
        let part = &bytes[tree.start(unit) as usize..tree.start(unit + 1) as usize];
        let began = Instant::now();
        let cells = tree.decode(unit, part).expect("a unit");
        seconds += began.elapsed().as_secs_f64();
        let mut counting = Counting { decoder: Decoder::new(part), bits: 0.0, decisions: 0 };
        tree.decode_with(unit, &mut counting).expect("a unit");
        (bits, splats) = (bits + counting.bits, splats + cells.piece.splats.len() as u64);
        decisions += counting.decisions;
        tree.take(unit, &cells);
    }
    let all = 8.0 * bytes.len() as f64 / summary.splats as f64;
    println!("bits a splat: {all:.3}, of positions behind the head {:.4}", bits / splats as f64);
    println!(
        "decoded: {:.2} M splats/s, {:.2} decisions a splat",
        splats as f64 / seconds / 1e6,
        decisions as f64 / splats as f64
    );
    normals(&levels, &tree);
}

/// Mean and greatest angle between the normals of the finest level and those in the file.
fn normals(levels: &SplatLevels, tree: &SplatTree) {
    let (mut sum, mut most, mut count) = (0.0, 0.0f64, 0u64);
    let each = |key: NodeKey, piece: &NodeCells<SplatInput>| {
        if key.level() < levels.deepest() {
            return Ok(());
        }
        let read = tree.pieces()[&key.code()].found_by_place();
        for cell in &piece.cells {
            let there = read.of(read.get(cell.at).expect("the cell"));
            for (wanted, splat) in piece.of(cell).iter().zip(there) {
                let SplatInput { normal, .. } = wanted;
                let other = tree.directions().vector(splat.normal);
                let [a, b] = [normal.map(f64::from), other.map(f64::from)];
                let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let cosine = dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
                let angle = cosine.min(1.0).acos().to_degrees();
                (sum, most, count) = (sum + angle, most.max(angle), count + 1);
            }
        }
        Ok(())
    };
    levels.each_node(each).expect("splats in memory");
    println!(
        "normals of the finest level: {:.3} degrees off in the mean, {most:.2} at most",
        sum / count as f64
    );
}

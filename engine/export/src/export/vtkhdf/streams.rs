//! The compressed points and cells of blocks.

use super::hdf5::Datatype;
use crate::analysis::BrickBlock;
use crate::export::zlib::Deflate;
use crate::lattice::{BRICK_CELLS, BRICK_POINTS};

/// Points of a block.
pub(super) const POINTS: usize = BRICK_POINTS * BRICK_POINTS * BRICK_POINTS;
/// Cells of a block.
pub(super) const CELLS: usize = BRICK_CELLS * BRICK_CELLS * BRICK_CELLS;

/// The streams of a block: its points, its cells.
pub(super) type Streams = [Vec<u8>; 2];

/// Makes the streams of blocks.
pub(super) struct StreamMaker {
    deflate: Deflate,
    whole: Vec<i16>,
    points: Vec<f32>,
    cells: Vec<f32>,
    bytes: Vec<u8>,
    /// The last uniform block.
    last: Option<(i16, Streams)>,
}

impl StreamMaker {
    /// Has made none.
    pub(super) fn new() -> StreamMaker {
        StreamMaker {
            deflate: Deflate::new(),
            whole: vec![0; POINTS],
            points: vec![0.0; POINTS],
            cells: vec![0.0; CELLS],
            bytes: Vec::new(),
            last: None,
        }
    }

    /// The streams of a block of one value.
    pub(super) fn uniform(&mut self, value: i16, kind: Datatype) -> Streams {
        if let Some((last, streams)) = &self.last
            && *last == value
        {
            return streams.clone();
        }
        self.whole.fill(value);
        self.points.fill(f32::from(value));
        let streams = self.pack(kind);
        self.last = Some((value, streams.clone()));
        streams
    }

    /// The streams of the samples of a block.
    pub(super) fn block(&mut self, block: &BrickBlock<'_>, kind: Datatype) -> Streams {
        for n in 0..BRICK_POINTS * BRICK_POINTS {
            let (at, row) = ([n % BRICK_POINTS, n / BRICK_POINTS], n * BRICK_POINTS..(n + 1) * BRICK_POINTS);
            match kind {
                Datatype::F32 => block.floats(at, &mut self.points[row]),
                _ => {
                    block.integers(at, &mut self.whole[row.clone()]);
                    let points = self.points[row.clone()].iter_mut();
                    points.zip(&self.whole[row]).for_each(|(point, &whole)| *point = f32::from(whole));
                }
            }
        }
        self.pack(kind)
    }

    fn pack(&mut self, kind: Datatype) -> Streams {
        self.bytes.clear();
        match kind {
            Datatype::F32 => put_floats(&self.points, &mut self.bytes),
            _ => [0, 8].iter().for_each(|shift| {
                self.bytes.extend(self.whole.iter().map(|whole| (whole >> shift) as u8));
            }),
        }
        let mut points = Vec::new();
        self.deflate.zlib(&self.bytes, 1, &near(BRICK_POINTS), &mut points);
        put_means(&self.points, &mut self.cells);
        self.bytes.clear();
        put_floats(&self.cells, &mut self.bytes);
        let mut cells = Vec::new();
        self.deflate.zlib(&self.bytes, 1, &near(BRICK_CELLS), &mut cells);
        [points, cells]
    }
}

/// How far back equal bytes are likely: the row before, and the layer before.
fn near(axis: usize) -> [usize; 2] {
    [axis, axis * axis]
}

/// Appends the lowest bytes of all numbers, then all next ones, and so on, as the filter *shuffle* of HDF5 has them.
fn put_floats(values: &[f32], out: &mut Vec<u8>) {
    [0, 8, 16, 24]
        .iter()
        .for_each(|shift| out.extend(values.iter().map(|value| (value.to_bits() >> shift) as u8)));
}

/// The means of the eight points of each cell.
fn put_means(points: &[f32], cells: &mut [f32]) {
    for (n, cells) in cells.as_chunks_mut::<BRICK_CELLS>().0.iter_mut().enumerate() {
        let (y, z) = (n % BRICK_CELLS, n / BRICK_CELLS);
        let row = |y: usize, z: usize| &points[(z * BRICK_POINTS + y) * BRICK_POINTS..][..BRICK_POINTS];
        let rows = [row(y, z), row(y + 1, z), row(y, z + 1), row(y + 1, z + 1)];
        let mut sums = [0.0; BRICK_POINTS];
        for row in rows {
            sums.iter_mut().zip(row).for_each(|(sum, point)| *sum += point);
        }
        cells.iter_mut().enumerate().for_each(|(x, cell)| *cell = (sums[x] + sums[x + 1]) / 8.0);
    }
}

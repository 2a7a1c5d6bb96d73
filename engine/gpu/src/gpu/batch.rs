//! What a thread and a device exchange: which device, the bricks of a batch, what became of them, and the seconds that it took.

use brickfield_shaders::{Brick, JUMP_WORDS, Pair, ROWS};

/// Which device to open, and how.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceSettings {
    /// Its number, or a part of its name in any case; the best one if not given.
    pub device: Option<String>,
    /// Only a GPU will do, no software driver, unless it is named.
    pub real: bool,
    /// Bytes of memory that may be allocated, on the device and here together; 0 for an eighth of the device's, from
    /// 64 MiB to 1 GiB.
    pub memory: u64,
    /// Copy to and from the device even where its memory is the host's, as is done for cards: for tests on a software
    /// driver.
    pub staging: bool,
    /// Have the validation layer look on.
    pub validation: bool,
}

/// Bricks to evaluate.
#[derive(Clone, Debug, Default)]
pub struct BatchInput {
    /// The bricks' corners.
    pub bricks: Vec<Brick>,
    /// Of each brick every triangle that touches it.
    pub pairs: Vec<Pair>,
    /// Whether the bricks may be divided.
    pub may_divide: bool,
}

impl BatchInput {
    /// Empties it of bricks.
    pub fn clear(&mut self) {
        self.bricks.clear();
        self.pairs.clear();
    }
}

/// What the device made of a batch.
#[derive(Debug)]
pub struct BatchOutput<'a> {
    /// What became of the bricks.
    pub bricks: &'a [Brick],
    /// By brick: by row, four a word, the jumps of the samples at edges along x, as
    /// [`brickfield_shaders::JUMP_BIAS`] tells; then those of the other lines, and which edges hold crossings.
    pub jumps: &'a [[u32; JUMP_WORDS as usize]],
    /// By brick and row: the first sample, and which edges along x hold crossings.
    pub rows: &'a [[[u32; 2]; ROWS as usize]],
    /// The Hermite edges of all bricks: offset and normal.
    pub hermite: &'a [[u32; 2]],
}

/// Kernels of a batch.
pub(super) const KERNELS: usize = 5;

/// Seconds that a batch took on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// To upload its input.
    pub upload: f64,
    /// To compute, by kernel.
    pub kernels: [f64; KERNELS],
    /// To read its results back.
    pub read: f64,
}

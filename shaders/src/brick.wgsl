// What the kernels that evaluate bricks have in common: their buffers.

struct Batch {
    pairs: u32,
    edges_max: u32,
    records_max: u32,
    edges: atomic<u32>,
    records: atomic<u32>,
}

struct Brick {
    origin_x: i32,
    origin_y: i32,
    origin_z: i32,
    shift: u32,
    corner: i32,
    flags: atomic<u32>,
    edges_from: u32,
    edges: u32,
    edges_x: u32,
    edges_y: u32,
}

@group(0) @binding(0) var<storage, read_write> batch: Batch;
@group(0) @binding(1) var<storage, read_write> bricks: array<Brick>;
// By pair of a triangle and a brick that it touches: three vertices of three coordinates each.
@group(0) @binding(2) var<storage, read> triangles: array<i32>;
// By pair: the brick.
@group(0) @binding(3) var<storage, read> owners: array<u32>;
// By sample, x fastest: the jump on the way to it, along x, or in the face x = 0 along y, or in the column x = y = 0
// along z. Behind those of a brick, by row: which edges along x hold crossings, as bits.
@group(0) @binding(4) var<storage, read_write> jumps: array<atomic<i32>>;
// By row of which an edge along x holds crossings: its samples, two a word, the first one low.
@group(0) @binding(5) var<storage, read_write> samples: array<u32>;
// By row: its first sample. Behind those of a brick, by row: which edges along x hold crossings.
@group(0) @binding(6) var<storage, read_write> rows: array<u32>;
// Which edges change sign, and where their places begin: see `changes_at` and `rank_at`.
@group(0) @binding(7) var<storage, read_write> tables: array<u32>;
// By sign-changing edge: how many crossings it holds, and the number of the last but the first one, from 1.
@group(0) @binding(8) var<storage, read_write> chains: array<atomic<u32>>;
// By sign-changing edge: the offset of the first crossing with its way, and its normal; in the end the Hermite edge's.
@group(0) @binding(9) var<storage, read_write> hermite: array<u32>;
// Crossings that are not the first ones of their edges.
@group(0) @binding(10) var<storage, read_write> records: array<u32>;

// Where it is kept which edges change sign that begin in a row, as bits over x: those along x, along y for x below 32
// and for x = 32, along z likewise.
fn changes_at(brick: u32, kind: u32, row: u32) -> u32 {
    return brick * TABLE_WORDS + kind * ROWS + row;
}

// Where it is kept how many sign-changing edges lie before a row's along an axis.
fn rank_at(brick: u32, axis: u32, row: u32) -> u32 {
    return brick * TABLE_WORDS + (5u + axis) * ROWS + row;
}

// Where the edges of a row along x are kept that hold crossings.
fn touched_at(brick: u32, row: u32) -> u32 {
    return brick * JUMP_WORDS + ROWS * POINTS + row;
}

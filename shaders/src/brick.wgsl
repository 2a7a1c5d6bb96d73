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
// along z.
@group(0) @binding(4) var<storage, read_write> jumps: array<atomic<i32>>;
// Two a word, the first one low.
@group(0) @binding(5) var<storage, read_write> samples: array<u32>;
@group(0) @binding(6) var<storage, read_write> tables: array<u32>;
// By sign-changing edge: the number of the last crossing on it, in the end its normal.
@group(0) @binding(7) var<storage, read_write> heads: array<atomic<u32>>;
// By sign-changing edge: the winding number at its lower sample, in the end the offset.
@group(0) @binding(8) var<storage, read_write> starts: array<u32>;
@group(0) @binding(9) var<storage, read_write> records: array<u32>;

// The sample of a brick at a linear index.
fn sample(brick: u32, index: u32) -> i32 {
    let word = samples[brick * SAMPLE_WORDS + (index >> 1u)];
    return extractBits(bitcast<i32>(word), 16u * (index & 1u), 16u);
}

// Which samples of row k·33 + j are inside: those of 0 to 31 as bits, and that of 32.
fn inside(brick: u32, row: u32) -> vec2<u32> {
    let at = brick * TABLE_WORDS + 2u * row;
    return vec2(tables[at], tables[at + 1u]);
}

// Where the number of a row's edges along an axis is counted.
fn rank_of(brick: u32, axis: u32, row: u32) -> u32 {
    return brick * TABLE_WORDS + (2u + axis) * ROWS + row;
}

// Which edges along an axis change sign that begin in a row, as bits over x; `axis` runs there.
fn changes(brick: u32, axis: u32, row: u32) -> vec2<u32> {
    let own = inside(brick, row);
    if axis == 0u {
        return vec2(own.x ^ ((own.x >> 1u) | (own.y << 31u)), 0u);
    }
    if axis == 1u {
        if row % POINTS == CELLS {
            return vec2(0u, 0u);
        }
        return own ^ inside(brick, row + 1u);
    }
    if row >= CELLS * POINTS {
        return vec2(0u, 0u);
    }
    return own ^ inside(brick, row + POINTS);
}

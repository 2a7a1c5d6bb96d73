// What the kernels that evaluate bricks have in common: their buffers.

struct Batch {
    pairs: u32,
    way_max: u32,
    other_max: u32,
    edges_max: u32,
    more_max: u32,
    way_spans: atomic<u32>,
    other_spans: atomic<u32>,
    edges: atomic<u32>,
    more: atomic<u32>,
    doubles: atomic<u32>,
}

struct Brick {
    corner: i32,
    flags: atomic<u32>,
    edges_from: u32,
    edges: u32,
    edges_x: u32,
    edges_y: u32,
    crossings: atomic<u32>,
}

@group(0) @binding(0) var<storage, read_write> batch: Batch;
@group(0) @binding(1) var<storage, read_write> bricks: array<Brick>;
// By pair of a triangle and a brick that it touches, in words of two numbers, the first one low: three vertices of three
// coordinates each relative to sample 0 of the brick, then the brick, and in the high half the logarithm of the distance
// of samples.
@group(0) @binding(2) var<storage, read> pairs: array<u64>;
// By line and edge, four a word, the first one lowest: the jump on the way to the sample behind it. Lines are the rows,
// along x, then those in the face x = 0 along y, then the column x = y = 0 along z. Behind those of a brick, as bits:
// which edges hold crossings, by line.
@group(0) @binding(3) var<storage, read_write> jumps: array<atomic<u32>>;
// By sign-changing edge, two a word, the first one low: how many crossings it holds.
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
// By row: its first sample, and in the high half which edges along x hold crossings.
@group(0) @binding(5) var<storage, read_write> rows: array<u64>;
// By brick, axis and row: which edges change sign that begin in the row, as bits over x; in the high half how many such
// edges lie before the row's, if it has any and there is room for the brick's, which bit 30 tells; bit 31 tells whether
// the one at x = 32 changes sign.
@group(0) @binding(6) var<storage, read_write> tables: array<u64>;
// By sign-changing edge: the number of its last crossing in `more`, from 1. All are 0 between two batches.
@group(0) @binding(7) var<storage, read_write> chains: array<atomic<u32>>;
// By sign-changing edge: the offset of the first crossing with its way, and in the high half its normal; in the end the
// Hermite edge's.
@group(0) @binding(8) var<storage, read_write> hermite: array<u64>;
// Lines that a triangle covers: first those that lead to samples, then the others. Its pair, and in the high half axis,
// first line and how many there are.
@group(0) @binding(9) var<storage, read_write> spans: array<u64>;
// By crossing of a sign-changing edge behind its second, two words: as in `hermite`; the one before it in the chain, from 1.
@group(0) @binding(10) var<storage, read_write> more: array<u64>;
// By pair that has a span: the triangle's normal as a Hermite edge has it.
@group(0) @binding(11) var<storage, read_write> normals: array<u32>;
// By sign-changing edge with several crossings: its place, and in the high half the sample where it begins with its brick.
@group(0) @binding(12) var<storage, read_write> doubles: array<u64>;
// By sign-changing edge: its second crossing, as in `hermite`.
@group(0) @binding(13) var<storage, read_write> seconds: array<u64>;

fn both(low: u32, high: u32) -> u64 {
    return u64(low) | (u64(high) << 32u);
}

fn low_of(both: u64) -> u32 {
    return u32(both & 0xfffffffflu);
}

fn high_of(both: u64) -> u32 {
    return u32(both >> 32u);
}

// An index, as it is. llvmpipe reads and writes for one of eight invocations after the other, and LLVM moves what only an
// index is made of, sums, products and shifts, there too: it leaves a minimum where it is, so that all eight are computed
// at once. Indices are far smaller.
fn whole(index: u32) -> u32 {
    return min(index, 0x7fffffffu);
}

fn table_at(brick: u32, axis: u32, row: u32) -> u32 {
    return whole((brick * 3u + axis) * ROWS + row);
}

fn row_at(brick: u32, row: u32) -> u32 {
    return whole(brick * ROWS + row);
}

// The lines in the face x = 0, by z.
fn face_line(z: u32) -> u32 {
    return ROWS + z;
}

// The one in the column.
const COLUMN_LINE = ROWS + POINTS;

// Where the jump at an edge of a line is kept, with those of three others.
fn jump_at(brick: u32, line: u32, edge: u32) -> u32 {
    return whole(brick * JUMP_WORDS + line * LINE_WORDS + (edge >> 2u));
}

// The jump at an edge, from its word. Words are sums of jumps times powers of 256.
fn jump_in(word: u32, edge: u32) -> i32 {
    return i32(((word + JUMP_BIAS) >> (8u * (edge & 3u))) & 0xffu) - 128i;
}

fn jump_to(brick: u32, line: u32, edge: u32) -> i32 {
    return jump_in(atomicLoad(&jumps[jump_at(brick, line, edge)]), edge);
}

// Where it is kept which edges of a line hold crossings.
fn touched_at(brick: u32, line: u32) -> u32 {
    return whole(brick * JUMP_WORDS + LINES * LINE_WORDS + line);
}

// The part of a list that a workgroup has: the first and the end. Parts are whole, so that what lies close in memory is
// used together.
fn part_of(count: u32, group: u32, groups: u32) -> vec2<u32> {
    let turns = (count + groups * WORKGROUP - 1u) / (groups * WORKGROUP);
    let each = turns * WORKGROUP;
    return vec2(min(group * each, count), min((group + 1u) * each, count));
}

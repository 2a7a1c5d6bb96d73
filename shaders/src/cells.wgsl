// The sum over a cluster tree at samples; twin of `winding/open/cells.rs`, in single precision with a bound on the error.
// One invocation has four samples in a row, so that what it reads serves four times. The sum of terms is one of integers,
// which loses nothing.

struct Sums {
    rows: u32,
    bits: u32,
}

struct Block {
    low_x: i32,
    low_y: i32,
    low_z: i32,
    spacing: u32,
    steps: u32,
    terms_from: u32,
    clusters: u32,
    elements: u32,
    base_low: u32,
    base_high: u32,
    bound: f32,
}

@group(0) @binding(2) var<storage, read> sums: Sums;
@group(0) @binding(3) var<storage, read> blocks: array<Block>;
// Numbers of clusters and of elements, block by block.
@group(0) @binding(5) var<storage, read> terms: array<u32>;
// The block; whether every second sample is meant; the place of the first in the block, three bits an axis.
@group(0) @binding(6) var<storage, read> rows: array<u32>;
// By row: four samples.
@group(0) @binding(7) var<storage, read_write> quanta: array<vec4<i32>>;

// Terms, less than 2 in magnitude, with TERM_BITS binary places, off by at most half of the last.
fn whole(term: vec4<f32>) -> vec4<i64> {
    return vec4<i64>(vec4<i32>(round(term * f32(1u << TERM_BITS))));
}

// The sample less the sum, if that is sure; `bound` has been added up in single precision.
fn rounded(total: i64, bound: f32, terms: u32) -> i32 {
    // Terms are rounded; the sum of their bounds is off by a ten thousandth.
    let slack = i64(bound * 1.001 * f32(1u << TERM_BITS)) + i64(i32(terms)) + 4li;
    let half = 1li << (TERM_BITS - 1u - sums.bits);
    let low = (half - total - slack) >> (TERM_BITS - sums.bits);
    let high = (half - total + slack) >> (TERM_BITS - sums.bits);
    let is_sure = bound < 0.1 && low == high && abs(low) < 0x40000000li;
    return select(bitcast<i32>(UNSURE), i32(low), is_sure);
}

@compute @workgroup_size(WORKGROUP)
fn sum_up(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= sums.rows {
        return;
    }
    let place = rows[id.x];
    let number = place >> 10u;
    let block = blocks[number];
    let stride = 1u + ((place >> 9u) & 1u);
    // The last ones may lie beyond the block: nobody asks for them.
    let kx = vec4(place & 7u) + vec4(0u, 1u, 2u, 3u) * stride;
    let ky = (place >> 3u) & 7u;
    let kz = (place >> 6u) & 7u;
    let row = Row(
        block.low_x + vec4<i32>(kx << vec4(block.spacing)),
        block.low_y + i32(ky << block.spacing),
        block.low_z + i32(kz << block.spacing),
    );
    // Exact: from the middle of the block, in units of four steps.
    let last = f32(block.steps - 1u);
    let far = polynomial(
        number, (vec4<f32>(2u * kx) - last) * 0.125, (f32(2u * ky) - last) * 0.125, (f32(2u * kz) - last) * 0.125
    );
    // Not i64(u32): naga 30 extends the sign.
    let base = bitcast<i64>(u64(block.base_low) | (u64(block.base_high) << 32u));
    var total = vec4(base) + whole(far);
    var bound = vec4(block.bound);
    var at = block.terms_from;
    let elements_from = at + block.clusters;
    for (; at < elements_from; at++) {
        total += whole(cluster_shares(terms[at] * CLUSTER_WORDS, row));
    }
    let end = elements_from + block.elements;
    for (; at < end; at++) {
        let shares = cap_shares(terms[at] * ELEMENT_WORDS, row);
        total += whole(shares.value);
        bound += shares.error;
    }
    let count = block.clusters + block.elements;
    quanta[id.x] = vec4(
        rounded(total.x, bound.x, count),
        rounded(total.y, bound.y, count),
        rounded(total.z, bound.z, count),
        rounded(total.w, bound.w, count),
    );
}

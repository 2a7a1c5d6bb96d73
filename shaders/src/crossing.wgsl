// Where lattice lines cross triangles.
//
// A span is a row of lines that a triangle covers: lines follow each other along the axis after theirs, so that the
// position of one leaves that of the next by an addition. Everything is decided in integers of 64 bits. The position of
// a crossing along its line is a quotient whose numerator has 75 bits; the numerator is kept modulo 2^64, and an estimate
// of the quotient in floats leaves a remainder that fits 64 bits, so that the remainder is exact, and shows how the
// estimate is to be corrected.

// A triangle with a brick that it touches.
struct Pair {
    a: vec3<i32>,
    b: vec3<i32>,
    c: vec3<i32>,
    brick: u32,
    shift: u32,
}

fn pair_of(number: u32) -> Pair {
    let at = number * (PAIR_WORDS / 2u);
    let w = array<u64, 5>(pairs[whole(at)], pairs[whole(at + 1u)], pairs[whole(at + 2u)], pairs[whole(at + 3u)], pairs[whole(at + 4u)]);
    let a = vec3(low_of(w[0]), high_of(w[0]), low_of(w[1]));
    let b = vec3(high_of(w[1]), low_of(w[2]), high_of(w[2]));
    let c = vec3(low_of(w[3]), high_of(w[3]), low_of(w[4]));
    let owner = high_of(w[4]);
    return Pair(bitcast<vec3<i32>>(a), bitcast<vec3<i32>>(b), bitcast<vec3<i32>>(c), owner & 0xffffu, owner >> 16u);
}

// Coordinates with an axis first and those after it in cyclic order behind.
fn rotated(p: vec3<i32>, axis: u32) -> vec3<i32> {
    return select(select(p.zxy, p.yzx, axis == 1u), p, axis == 0u);
}

// A quotient: whole units, and the rest as a numerator over the divisor.
struct Depth {
    units: i32,
    rest: i64,
}

// The quotient of a numerator, given modulo 2^64, and a positive `n` below 2^49. `estimate` is off by less than 2^55 / n
// and a few units.
fn divide(numerator: i64, n: i64, per_n: f32, estimate: i32) -> Depth {
    var units = estimate;
    var rest = numerator - i64(estimate) * n;
    // Each step leaves a 2^18th of what it finds, or a unit, of which the next one is sure.
    for (var i = 0u; i < 6u; i++) {
        if rest >= 0li && rest < n {
            break;
        }
        var more = i32(floor(f32(rest) * per_n));
        if more == 0i {
            more = 1i;
        }
        units += more;
        rest -= i64(more) * n;
    }
    return Depth(units, rest);
}

// The distance from the sample before in 1/65536 of the spacing, rounded to nearest and at most 65535. `beyond` are the
// whole units.
fn offset_of(beyond: i32, rest: i64, n: i64, per_n: f32, shift: u32) -> u32 {
    // The rest in 1/65536 of a unit; the estimate is off by one at most.
    var fine = i32(f32(rest) * per_n * 65536.0);
    let left = (rest << 16u) - i64(fine) * n;
    if left < 0li {
        fine -= 1i;
    } else if left >= n {
        fine += 1i;
    }
    let half = 1i << (shift - 1u);
    let offset = ((i64(beyond) << 16u) + i64(half + fine)) >> shift;
    return u32(min(offset, 65535li));
}

// The lines of a span, and where they cross the triangle.
struct Span {
    pair: u32,
    brick: u32,
    shift: u32,
    axis: u32,
    // Of the first line, along the axes after `axis`.
    line: vec2<u32>,
    lines: u32,
    // Which way the winding number jumps.
    jump: i32,
    // Whether a crossing at a sample lies before it.
    ties_before: bool,
    // The crossing with the first line, from there to the next one, and the divisor of both rests.
    depth: Depth,
    step: Depth,
    across: i64,
    per_n: f32,
}

fn span_of(packed: u64) -> Span {
    let number = low_of(packed);
    let what = high_of(packed);
    let axis = what & 3u;
    let line = vec2((what >> 2u) & 63u, (what >> 8u) & 63u);
    let pair = pair_of(number);
    let shift = pair.shift;
    let a = rotated(pair.a, axis);
    let b = rotated(pair.b, axis);
    let c = rotated(pair.c, axis);
    let n = normal_of(a, b, c);
    let side = sign_of(n[0]);
    // The numerator of the depth at the line, over a positive number.
    let across = n[0] * i64(side);
    let slope_u = n[1] * i64(side);
    let slope_v = n[2] * i64(side);
    let from_line = a.yz - (vec2<i32>(line) << vec2(shift));
    let numerator = across * i64(a.x) + slope_u * i64(from_line.x) + slope_v * i64(from_line.y);
    let per_n = 1.0 / f32(across);
    let tilt = vec2(f32(slope_u), f32(slope_v)) * per_n;
    // Rounding leaves an error of 2^-21 of each term, whose numerators are below 2^74.
    let estimate = f32(a.x) + tilt.x * f32(from_line.x) + tilt.y * f32(from_line.y);
    let low = f32(min(min(a.x, b.x), c.x));
    let high = f32(max(max(a.x, b.x), c.x));
    let depth = divide(numerator, across, per_n, i32(floor(clamp(estimate, low, high))));
    // If there is a next line, the triangle reaches as far.
    let estimate_step = clamp(-tilt.x * f32(1u << shift), low - high, high - low);
    let step = divide(-(slope_u << shift), across, per_n, i32(floor(estimate_step)));
    let ties_before = leading_sign(n, axis) == side;
    return Span(number, pair.brick, shift, axis, line, what >> 14u, -side, ties_before, depth, step, across, per_n);
}

// On to the next line.
fn next_depth(span: Span, depth: Depth) -> Depth {
    let units = depth.units + span.step.units;
    let rest = depth.rest + span.step.rest;
    let carries = rest >= span.across;
    return Depth(units + i32(carries), select(rest, rest - span.across, carries));
}

// The edge of a line that holds a crossing, which may lie beside the brick, and how far from its beginning in units.
fn edge_at(span: Span, depth: Depth) -> vec2<i32> {
    let lower = depth.units >> span.shift;
    let beyond = depth.units & ((1i << span.shift) - 1i);
    // On a sample: it lies behind the crossing if the perturbed sample is on the side that the line leaves to.
    let is_before = depth.rest == 0li && beyond == 0i && span.ties_before;
    return select(vec2(lower, beyond), vec2(lower - 1i, 1i << span.shift), is_before);
}

// All spans of a batch: those that lead to samples, and behind the room for them the others.
struct Spans {
    way_max: u32,
    ways: u32,
    count: u32,
}

fn all_spans() -> Spans {
    let way_max = batch.way_max;
    let ways = min(atomicLoad(&batch.way_spans), way_max);
    return Spans(way_max, ways, ways + min(atomicLoad(&batch.other_spans), batch.other_max));
}

fn listed(all: Spans, number: u32) -> u64 {
    return spans[whole(select(all.way_max - all.ways, 0u, number < all.ways) + number)];
}

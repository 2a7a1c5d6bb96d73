// Crossings of triangles with the axis-parallel lines of the bricks that they touch; twin of `winding/scan.rs`.
//
// `find` lists which lines pass through which triangle, `locate` where, an invocation a crossing: triangles have few
// crossings or many, so that invocations of a triangle each, in step, would mostly wait for each other. Everything is
// decided in integers of 64 bits. Edge functions stay below 2^51. The position of a crossing along its line is a quotient
// whose numerator has 75 bits; the numerator is kept modulo 2^64, and an estimate of the quotient in floats leaves a
// remainder that fits 64 bits, so that the remainder is exact, and shows how the estimate is to be corrected.

// An edge function of a projected triangle, along the axes u and v.
struct EdgeFunction {
    // At a line, less one where a tie counts as outside: not negative where the line is inside.
    at: i64,
    step_u: i64,
    step_v: i64,
}

fn edge_function(p: vec3<i32>, q: vec3<i32>, side: i32, u_first: bool, line: vec2<i32>, shift: u32) -> EdgeFunction {
    let along_u = side * (p.z - q.z);
    let along_v = side * (q.y - p.y);
    // ε belongs to the axis that comes first in x, y, z.
    let first = select(along_v, along_u, u_first);
    let second = select(along_u, along_v, u_first);
    let outside = i32(select(second, first, first != 0i) <= 0i);
    let value = i64(along_v) * i64(line.y - p.z) + i64(along_u) * i64(line.x - p.y);
    return EdgeFunction(value - i64(outside), i64(along_u) << shift, i64(along_v) << shift);
}

// Where a line crosses a plane: whole units, and the rest as a numerator over `n`.
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
    let w = array<u64, 5>(pairs[at], pairs[at + 1u], pairs[at + 2u], pairs[at + 3u], pairs[at + 4u]);
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

// Lists the lines along `axis` inside the triangle. Vertices are relative to sample 0 of the brick and rotated.
fn find_along(axis: u32, pair: u32, brick: u32, a: vec3<i32>, b: vec3<i32>, c: vec3<i32>, across: i64, shift: u32) {
    let low = min(min(a, b), c);
    let high = max(max(a, b), c);
    let below = (1i << shift) - 1i;
    let first = max((low.yz + below) >> vec2(shift), vec2(0i));
    let last = min(high.yz >> vec2(shift), vec2(i32(CELLS)));
    if any(first > last) || across == 0li {
        return;
    }
    let side = sign_of(across);
    let line = first << vec2(shift);
    var ab = edge_function(a, b, side, axis != 1u, line, shift);
    var bc = edge_function(b, c, side, axis != 1u, line, shift);
    var ca = edge_function(c, a, side, axis != 1u, line, shift);
    let crossings_max = batch.crossings_max;
    var u = first.x;
    var v = first.y;
    var at_ab = ab.at;
    var at_bc = bc.at;
    var at_ca = ca.at;
    var begins = true;
    // Ends: at most 33² lines.
    loop {
        // On to the next line inside: a short loop of its own, so that most of the invocations that run in step have a
        // crossing when the rest begins.
        loop {
            if !begins {
                u += 1i;
                at_ab += ab.step_u;
                at_bc += bc.step_u;
                at_ca += ca.step_u;
                if u > last.x {
                    u = first.x;
                    v += 1i;
                    ab.at += ab.step_v;
                    bc.at += bc.step_v;
                    ca.at += ca.step_v;
                    at_ab = ab.at;
                    at_bc = bc.at;
                    at_ca = ca.at;
                }
            }
            begins = false;
            if v > last.y || (at_ab | at_bc | at_ca) >= 0li {
                break;
            }
        }
        if v > last.y {
            break;
        }
        let number = atomicAdd(&batch.crossings, 1u);
        if number >= crossings_max {
            atomicOr(&bricks[brick].flags, FULL);
            break;
        }
        crossings[number] = both(pair, axis | (u32(u) << 2u) | (u32(v) << 8u));
    }
}

@compute @workgroup_size(WORKGROUP)
fn find(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= batch.pairs {
        return;
    }
    let pair = pair_of(id.x);
    var a = pair.a;
    var b = pair.b;
    var c = pair.c;
    let n = normal_of(a, b, c);
    normals[id.x] = encode_normal(n);
    for (var axis = 0u; axis < 3u; axis++) {
        let across = select(select(n[2], n[1], axis == 1u), n[0], axis == 0u);
        find_along(axis, id.x, pair.brick, a, b, c, across, pair.shift);
        a = a.yzx;
        b = b.yzx;
        c = c.yzx;
    }
}

// Adds up the jump at a crossing if it lies on the way to a sample: along x anywhere, along y in the face x = 0, along z
// in the column x = y = 0. `line` are the indices along the axes after `axis`.
fn jump_at(axis: u32, brick: u32, line: vec2<u32>, lower: u32, jump: i32) {
    var index: u32;
    var counts = true;
    if axis == 0u {
        index = (line.y * POINTS + line.x) * POINTS + lower + 1u;
        atomicOr(&jumps[touched_at(brick, line.y * POINTS + line.x)], bitcast<i32>(1u << lower));
    } else if axis == 1u {
        index = (line.x * POINTS + lower + 1u) * POINTS;
        counts = line.y == 0u;
    } else {
        index = (lower + 1u) * ROWS;
        counts = (line.x | line.y) == 0u;
    }
    if counts {
        atomicAdd(&jumps[brick * JUMP_WORDS + index], jump);
    }
}

// The sample at which an edge begins.
fn edge_start(axis: u32, line: vec2<u32>, lower: u32) -> u32 {
    let ijk = select(select(vec3(line, lower), vec3(line.y, lower, line.x), axis == 1u), vec3(lower, line), axis == 0u);
    return (ijk.z * POINTS + ijk.y) * POINTS + ijk.x;
}

fn locate_one(number: u32) {
    let crossing = crossings[number];
    let pair = pair_of(low_of(crossing));
    let packed = high_of(crossing);
    let axis = packed & 3u;
    let line = vec2((packed >> 2u) & 63u, packed >> 8u);
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
    var lower = depth.units >> shift;
    var beyond = depth.units & ((1i << shift) - 1i);
    // On a sample: it lies behind the crossing if the perturbed sample is on the side that the line leaves to.
    if depth.rest == 0li && beyond == 0i && leading_sign(n, axis) == side {
        lower -= 1i;
        beyond = 1i << shift;
    }
    if lower < 0i || lower >= i32(CELLS) {
        positions[number] = u64(NOWHERE);
        return;
    }
    let falls = u32(side > 0i);
    let offset = offset_of(beyond, depth.rest, across, per_n, shift);
    let edge = edge_start(axis, line, u32(lower)) | (axis << 16u);
    positions[number] = both(edge, offset | (falls << 16u) | (pair.brick << 17u));
    jump_at(axis, pair.brick, line, u32(lower), -side);
}

@compute @workgroup_size(WORKGROUP)
fn locate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = min(atomicLoad(&batch.crossings), batch.crossings_max);
    for (var number = id.x; number < count; number += groups.x * WORKGROUP) {
        locate_one(number);
    }
}

// Crossings of one triangle with the axis-parallel lines of a brick; twin of `winding/scan.rs`.
//
// Everything is decided in integers of 64 bits. Edge functions stay below 2^51. The position of a crossing along its
// line is a quotient whose numerator has 75 bits; the numerator is kept modulo 2^64, and an estimate of the quotient
// in floats leaves a remainder that fits 64 bits, so that the remainder is exact, and shows how the estimate is to be
// corrected. The file that is compiled together with this one has
//     fn hit(axis: u32, brick: u32, line: vec2<u32>, lower: u32, offset: u32)
// and takes the crossings: `line` are the indices along the axes after `axis` in cyclic order.

// The side of the triangle on which the normal's first component that is not 0 lies.
fn leading_sign(n: array<i64, 3>) -> i32 {
    var lead = sign_of(n[2]);
    if n[1] != 0li { lead = sign_of(n[1]); }
    if n[0] != 0li { lead = sign_of(n[0]); }
    return lead;
}

fn sign_of(c: i64) -> i32 {
    return select(select(0i, 1i, c > 0li), -1i, c < 0li);
}

// Twice the area vector. With the coordinates rotated, its components are.
fn normal_of(a: vec3<i32>, b: vec3<i32>, c: vec3<i32>) -> array<i64, 3> {
    let e = b - a;
    let f = c - a;
    return array<i64, 3>(
        i64(e.y) * i64(f.z) - i64(e.z) * i64(f.y),
        i64(e.z) * i64(f.x) - i64(e.x) * i64(f.z),
        i64(e.x) * i64(f.y) - i64(e.y) * i64(f.x),
    );
}

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

// Hands every crossing with lines along `axis` to `hit`. Vertices are relative to sample 0 of the brick and rotated so
// that `axis` comes first. Lines have indices up to `limit`.
fn scan(
    axis: u32,
    brick: u32,
    a: vec3<i32>,
    b: vec3<i32>,
    c: vec3<i32>,
    lead: i32,
    shift: u32,
    limit: vec2<i32>,
    with_offset: bool,
) {
    let low = min(min(a, b), c);
    let high = max(max(a, b), c);
    let below = (1i << shift) - 1i;
    let first = max((low.yz + below) >> vec2(shift), vec2(0i));
    let last = min(high.yz >> vec2(shift), limit);
    if any(first > last) {
        return;
    }
    let n = normal_of(a, b, c);
    if n[0] == 0li {
        return;
    }
    let side = sign_of(n[0]);
    let line = first << vec2(shift);
    var ab = edge_function(a, b, side, axis != 1u, line, shift);
    var bc = edge_function(b, c, side, axis != 1u, line, shift);
    var ca = edge_function(c, a, side, axis != 1u, line, shift);
    // The numerator of the depth at a line, and what it changes by from line to line.
    let across = n[0] * i64(side);
    let slope_u = n[1] * i64(side);
    let slope_v = n[2] * i64(side);
    let numerator = across * i64(a.x) + slope_u * i64(a.y) + slope_v * i64(a.z);
    let per_n = 1.0 / f32(across);
    let tilt = vec2(f32(slope_u), f32(slope_v)) * per_n;
    let extent = vec2(f32(low.x), f32(high.x));
    var u = first.x;
    var v = first.y;
    var at_ab = ab.at;
    var at_bc = bc.at;
    var at_ca = ca.at;
    var begins = true;
    // Ends: at most 33² lines.
    loop {
        // On to the next line inside: a short loop of its own, so that most of the invocations that run in step have a
        // crossing when the long rest begins.
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
        let at = vec2(u << shift, v << shift);
        let from_a = vec2<f32>(a.yz - at);
        // Rounding leaves an error of 2^-21 of each term, whose numerators are below 2^74.
        let estimate = clamp(f32(a.x) + tilt.x * from_a.x + tilt.y * from_a.y, extent.x, extent.y);
        let exact = numerator - slope_u * i64(at.x) - slope_v * i64(at.y);
        let depth = divide(exact, across, per_n, i32(floor(estimate)));
        var lower = depth.units >> shift;
        var beyond = depth.units & below;
        // On a sample: it lies behind the crossing if the perturbed sample is on the side that the line leaves to.
        if depth.rest == 0li && beyond == 0i && lead == side {
            lower -= 1i;
            beyond = 1i << shift;
        }
        if lower >= 0i && lower < i32(CELLS) {
            var offset = 0u;
            if with_offset {
                offset = offset_of(beyond, depth.rest, across, per_n, shift);
            }
            hit(axis, brick, vec2(u32(u), u32(v)), u32(lower), offset);
        }
    }
}

// A vertex of a triangle.
fn vertex(triangle: u32, number: u32) -> vec3<i32> {
    let at = 9u * triangle + 3u * number;
    return vec3(triangles[at], triangles[at + 1u], triangles[at + 2u]);
}

// Sample 0 of a brick.
fn origin_of(brick: u32) -> vec3<i32> {
    return vec3(bricks[brick].origin_x, bricks[brick].origin_y, bricks[brick].origin_z);
}

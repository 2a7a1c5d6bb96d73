// The share of the full view that one cap covers; twin of `winding/open/angle.rs`, in single precision with a bound on
// the error.

// Three vertices of three coordinates, and twice the area vector as floats.
@group(0) @binding(1) var<storage, read> elements: array<i32>;

// Nearer to a cap's edge than this, squared, as a share of 1, the processor decides.
const NEAR: f32 = 1.0 / 16384.0;
// The error of den: three scalar products of directions, each coordinate 6.5 ULP off, take 16 ULP each, and the sum of
// numbers up to 4 takes 9.
const DEN_ERROR: f32 = 60.0 * ULP;
// The error of num as a share of the sum of its terms' magnitudes: 4.5 ULP of the terms, 13.5 of the three lengths,
// 3 of the products.
const NUM_ERROR: f32 = 24.0 * ULP;

// Four vectors with the same y and z.
struct Ways {
    x: vec4<f32>,
    y: f32,
    z: f32,
}

// Four vectors.
struct Directions {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// From four samples in a row to a corner. Differences of integers are exact, their conversion is not.
fn corner(at: u32, row: Row) -> Ways {
    return Ways(
        vec4<f32>(vec4(elements[at]) - row.x), f32(elements[at + 1u] - row.y), f32(elements[at + 2u] - row.z)
    );
}

fn inverse_lengths(a: Ways) -> vec4<f32> {
    return inverseSqrt(a.x * a.x + (a.y * a.y + a.z * a.z));
}

fn directions(a: Ways, inverse: vec4<f32>) -> Directions {
    return Directions(a.x * inverse, a.y * inverse, a.z * inverse);
}

fn cosines(u: Directions, v: Directions) -> vec4<f32> {
    return u.x * v.x + u.y * v.y + u.z * v.z;
}

// The signed share, seen from four samples in a row, of the cap whose words begin at `at`.
//
// tan(Ω/2) = num/den (Van Oosterom & Strackee 1983, eq. 8), both divided by |a||b||c|. An error (Δnum, Δden) that is
// small against the length h of (den, num), at most an eighth of it, turns that vector by at most
// (|den|Δnum + |num|Δden + 2ΔnumΔden) / (7/8 h)². Where num may have the other sign the angle is as sure, unless den is
// negative: there p is close to the cap itself.
fn cap_shares(at: u32, row: Row) -> Bounded {
    let a = corner(at, row);
    let b = corner(at + 3u, row);
    let c = corner(at + 6u, row);
    let normal = vec3(
        bitcast<f32>(elements[at + 9u]), bitcast<f32>(elements[at + 10u]), bitcast<f32>(elements[at + 11u])
    );
    let ia = inverse_lengths(a);
    let ib = inverse_lengths(b);
    let ic = inverse_lengths(c);
    let u = directions(a, ia);
    let v = directions(b, ib);
    let w = directions(c, ic);
    let term_x = normal.x * a.x;
    let term_y = normal.y * a.y;
    let term_z = normal.z * a.z;
    let inverse = ia * ib * ic;
    let num = (term_x + term_y + term_z) * inverse;
    let num_error = NUM_ERROR * (abs(term_x) + abs(term_y) + abs(term_z)) * inverse;
    let den = 1.0 + cosines(u, v) + cosines(v, w) + cosines(w, u);
    let above = abs(num);
    let squared = num * num + den * den;
    let is_near = (squared < vec4(NEAR)) | (256.0 * num_error * num_error > squared)
        | ((den < vec4(0.0)) & (above <= num_error));
    let angle = angle_of(above, den);
    let turned = 1.4 * (abs(den) * num_error + (above + 2.0 * num_error) * DEN_ERROR) / squared;
    // The product with 1/2π takes 2 ULP.
    let error = 0.16 * (turned + angle.error + 2.0 * ULP * angle.value);
    let share = angle.value * 0.15915494;
    return Bounded(select(share, -share, num < vec4(0.0)), select(error, vec4(1.0), is_near));
}

// Normals of triangles in lattice units, and how Hermite edges hold them.

// The sign of the normal's first component along x, y, z that is not 0, given those from `axis` on in cyclic order: the
// side of the triangle on which perturbed samples on it lie.
fn leading_sign(n: array<i64, 3>, axis: u32) -> i32 {
    let x = select(select(n[1], n[2], axis == 1u), n[0], axis == 0u);
    let y = select(select(n[2], n[0], axis == 1u), n[1], axis == 0u);
    let z = select(select(n[0], n[1], axis == 1u), n[2], axis == 0u);
    return sign_of(select(select(z, y, y != 0li), x, x != 0li));
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

fn magnitude(c: i64) -> i64 {
    return select(c, -c, c < 0li);
}

// A coordinate of the octahedral code, rounded; the divisor is positive. Integers of 64 bits are not divided: some drivers
// cannot compile that.
fn scaled(c: i64, sum: i64) -> i32 {
    let value = c * 65534li + sum;
    let divisor = 2li * sum;
    // At most 32,768, so that the estimate is off by one at most.
    var quotient = i32(floor(f32(value) / f32(divisor)));
    let rest = value - i64(quotient) * divisor;
    quotient += i32(rest >= divisor) - i32(rest < 0li);
    return quotient;
}

// Twin of `OctNormal::from_integer`.
fn encode_normal(n: array<i64, 3>) -> u32 {
    let largest = max(max(magnitude(n[0]), magnitude(n[1])), magnitude(n[2]));
    if largest == 0li {
        return 0u;
    }
    let high = u32(largest >> 32u);
    let bits = select(64u - countLeadingZeros(high), 32u - countLeadingZeros(u32(largest & 0xffffffffli)), high == 0u);
    let right = max(bits, 31u) - 31u;
    let left = 31u - min(bits, 31u);
    let x = (n[0] >> right) << left;
    let y = (n[1] >> right) << left;
    let z = (n[2] >> right) << left;
    let sum = magnitude(x) + magnitude(y) + magnitude(z);
    var u = scaled(x, sum);
    var v = scaled(y, sum);
    if z < 0li {
        let u_folded = (32767i - abs(v)) * select(1i, -1i, u < 0i);
        let v_folded = (32767i - abs(u)) * select(1i, -1i, v < 0i);
        u = u_folded;
        v = v_folded;
    }
    return (bitcast<u32>(u) & 0xffffu) | (bitcast<u32>(v) << 16u);
}

// What a cluster adds to the sum; twin of `Expansion` in `winding/open/moments.rs`, in single precision. The host bounds
// its error.

// Centre, rounded; what the rounding took; a power of two not below the reach; dipole, quadrupole, octupole divided by
// its square, cube and fourth power.
@group(0) @binding(0) var<storage, read> clusters: array<i32>;

fn cluster_word(at: u32) -> f32 {
    return bitcast<f32>(clusters[at]);
}

// The shares, seen from four samples in a row, of the cluster whose words begin at `at`.
fn cluster_shares(at: u32, row: Row) -> vec4<f32> {
    let rx = vec4<f32>(vec4(clusters[at]) - row.x) + cluster_word(at + 3u);
    let ry = f32(clusters[at + 1u] - row.y) + cluster_word(at + 4u);
    let rz = f32(clusters[at + 2u] - row.z) + cluster_word(at + 5u);
    let inverse = inverseSqrt(rx * rx + (ry * ry + rz * rz));
    let x = rx * inverse;
    let y = ry * inverse;
    let z = rz * inverse;
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    let s = cluster_word(at + 6u) * inverse;
    let linear = x * cluster_word(at + 7u) + y * cluster_word(at + 8u) + z * cluster_word(at + 9u);
    let square = xx * cluster_word(at + 10u) + yy * cluster_word(at + 11u) + zz * cluster_word(at + 12u)
        + y * (x * cluster_word(at + 13u) + z * cluster_word(at + 14u)) + z * cluster_word(at + 15u) * x;
    let cube = x * (xx * cluster_word(at + 16u) + yy * cluster_word(at + 21u) + zz * cluster_word(at + 23u))
        + y * (yy * cluster_word(at + 17u) + xx * cluster_word(at + 19u) + zz * cluster_word(at + 24u))
        + z * (zz * cluster_word(at + 18u) + xx * cluster_word(at + 20u) + yy * cluster_word(at + 22u))
        + x * cluster_word(at + 25u) * y * z;
    return (linear + s * (square + s * cube)) * s * s;
}

// The sum of the solid angles of all triangles at each point (Jacobson et al. 2013; per triangle Van Oosterom &
// Strackee 1983, eq. 8); twin of `winding/brute.rs`, in single precision. One invocation has one point. Angles are
// added as fixed-point numbers, so that the sum does not depend on how it is divided.

struct Sum {
    points: u32,
    facets: u32,
}

@group(0) @binding(0) var<storage, read> sum: Sum;
// Three vertices of three coordinates each.
@group(0) @binding(1) var<storage, read> facets: array<f32>;
@group(0) @binding(2) var<storage, read> points: array<f32>;
// By part of the facets and point.
@group(0) @binding(3) var<storage, read_write> angles: array<i64>;

// The arc tangent of numbers from 0 to 1, within 2e-7: folded at tan(π/8), then the odd polynomial of Cephes' atanf.
fn arc_tangent(t: f32) -> f32 {
    let folds = t > 0.41421356;
    let x = select(t, (t - 1.0) / (t + 1.0), folds);
    let z = x * x;
    let p = ((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1;
    return select(0.0, 0.78539816, folds) + (p * z * x + x);
}

// The angle of (x, y), as `atan2` has it; drivers' own differ by thousands of units in the last place.
fn angle(y: f32, x: f32) -> f32 {
    let high = max(abs(x), abs(y));
    if high == 0.0 {
        return 0.0;
    }
    let low = min(abs(x), abs(y));
    var a = arc_tangent(low / high);
    if abs(y) > abs(x) { a = 1.5707964 - a; }
    if x < 0.0 { a = 3.1415927 - a; }
    return select(a, -a, y < 0.0);
}

@compute @workgroup_size(WORKGROUP)
fn add_up(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= sum.points {
        return;
    }
    let p = vec3(points[3u * id.x], points[3u * id.x + 1u], points[3u * id.x + 2u]);
    var total = 0li;
    let end = min((id.y + 1u) * STEPS_MAX, sum.facets);
    for (var facet = id.y * STEPS_MAX; facet < end; facet++) {
        let at = 9u * facet;
        let a = vec3(facets[at], facets[at + 1u], facets[at + 2u]) - p;
        let b = vec3(facets[at + 3u], facets[at + 4u], facets[at + 5u]) - p;
        let c = vec3(facets[at + 6u], facets[at + 7u], facets[at + 8u]) - p;
        let la = length(a);
        let lb = length(b);
        let lc = length(c);
        let above = dot(a, cross(b, c));
        let beside = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        // Exact but for what lies below the last place.
        total += i64(2.0 * angle(above, beside) * f32(1u << (ANGLE_BITS / 2u)) * f32(1u << (ANGLE_BITS / 2u)));
    }
    angles[id.y * sum.points + id.x] = total;
}

//! What two triangles on an integer grid have in common, by clipping one with the other in exact fractions: a way that
//! shares neither formulas nor code with the test of pairs.

use crate::check::Meeting;

/// A vertex.
pub(super) type GridPoint = [i64; 3];
type Big = [i128; 3];
/// A point of the plane of a triangle: (s, t, w) is p + (s/w)(q − p) + (t/w)(r − p), w > 0.
type Fraction = [i128; 3];

/// Pairs as a search should find them.
#[derive(Default)]
pub(super) struct ExpectedPairs {
    pub(super) crossing: u64,
    pub(super) overlapping: u64,
    pub(super) touching: u64,
    pub(super) pairs: Vec<([u32; 2], Meeting)>,
}

fn minus(a: Big, b: Big) -> Big {
    std::array::from_fn(|n| a[n] - b[n])
}

fn cross(u: Big, v: Big) -> Big {
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn dot(u: Big, v: Big) -> i128 {
    (0..3).map(|n| u[n] * v[n]).sum()
}

fn normal([p, q, r]: [Big; 3]) -> Big {
    cross(minus(q, p), minus(r, p))
}

/// Six times the volume of the tetrahedron, positive if s is on the side from which p, q, r are counter-clockwise.
pub(super) fn determinant(p: GridPoint, q: GridPoint, r: GridPoint, s: GridPoint) -> i128 {
    let [p, q, r, s] = [p, q, r, s].map(|g| g.map(i128::from));
    dot(normal([p, q, r]), minus(s, p))
}

/// Half-spaces whose intersection is the triangle: n·x ≥ d.
fn half_spaces(t: [Big; 3]) -> Vec<(Big, i128)> {
    let n = normal(t);
    let mut all = vec![(n, dot(n, t[0])), (n.map(|c| -c), -dot(n, t[0]))];
    for i in 0..3 {
        let inward = cross(n, minus(t[(i + 1) % 3], t[i]));
        all.push((inward, dot(inward, t[i])));
    }
    all
}

fn reduced([s, t, w]: Fraction) -> Fraction {
    let gcd = |mut a: i128, mut b: i128| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a.abs()
    };
    let divisor = gcd(gcd(s, t), w);
    [s / divisor, t / divisor, w / divisor]
}

/// The corners of what triangles `a` and `b` have in common, in `a`'s own coordinates; perhaps with repetitions.
fn common(a: [Big; 3], b: [Big; 3]) -> Vec<Fraction> {
    let (u, v) = (minus(a[1], a[0]), minus(a[2], a[0]));
    let mut polygon: Vec<Fraction> = vec![[0, 0, 1], [1, 0, 1], [0, 1, 1]];
    for (n, d) in half_spaces(b) {
        let height = |[s, t, w]: Fraction| dot(n, u) * s + dot(n, v) * t + (dot(n, a[0]) - d) * w;
        let mut clipped = Vec::new();
        for (i, &from) in polygon.iter().enumerate() {
            let to = polygon[(i + 1) % polygon.len()];
            let (h, k) = (height(from), height(to));
            if h >= 0 {
                clipped.push(from);
            }
            if h.signum() * k.signum() < 0 {
                let (h, k) = (h.abs(), k.abs());
                clipped.push(reduced(std::array::from_fn(|n| from[n] * k + to[n] * h)));
            }
        }
        polygon = clipped;
    }
    polygon
}

/// Twice the area of a polygon in the triangle's own coordinates is not zero.
fn has_area(polygon: &[Fraction]) -> bool {
    // Convex and counter-clockwise: some three corners make an area or none do.
    let area = |[p, q, r]: [Fraction; 3]| {
        p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0])
            + p[2] * (q[0] * r[1] - q[1] * r[0])
    };
    polygon.windows(2).any(|pair| area([polygon[0], pair[0], pair[1]]) != 0)
}

/// Whether an edge of `a` passes through the inside of `b`.
fn pierces(a: [Big; 3], b: [Big; 3]) -> bool {
    let spaces = half_spaces(b);
    let (n, d) = spaces[0];
    (0..3).any(|i| {
        let (p, q) = (a[i], a[(i + 1) % 3]);
        let (h, k) = (dot(n, p) - d, dot(n, q) - d);
        let (weight_q, weight_p) = (h.abs(), k.abs());
        h.signum() * k.signum() < 0
            && spaces[2..].iter().all(|(inward, d)| {
                dot(*inward, p) * weight_p + dot(*inward, q) * weight_q > d * (weight_p + weight_q)
            })
    })
}

/// How triangles meet that should not.
fn meeting(vertices: &[GridPoint], s: [u32; 3], t: [u32; 3]) -> Option<Meeting> {
    let corners = |t: [u32; 3]| t.map(|v| vertices[v as usize].map(i128::from));
    let (a, b) = (corners(s), corners(t));
    let polygon = common(a, b);
    // Corners of a that both have; what is between them is allowed.
    let own: Vec<usize> = (0..3).filter(|&i| t.contains(&s[i])).collect();
    let places: [Fraction; 3] = [[0, 0, 1], [1, 0, 1], [0, 1, 1]];
    let allowed = |point: &Fraction| match own[..] {
        [] => false,
        [i] => *point == places[i],
        // The third coordinate of barycentric ones: that of the corner which is not common is zero.
        [_, _] => {
            let other = (0..3).find(|i| !own.contains(i)).expect("a third corner");
            [point[2] - point[0] - point[1], point[0], point[1]][other] == 0
        }
        _ => false,
    };
    if polygon.iter().all(allowed) {
        return None;
    }
    if has_area(&polygon) {
        return Some(Meeting::Overlapping);
    }
    let crossing = pierces(a, b) || pierces(b, a);
    Some(if crossing { Meeting::Crossing } else { Meeting::Touching })
}

/// Triangles without area, and what all pairs of the others do.
pub(super) fn expected(vertices: &[GridPoint], triangles: &[[u32; 3]]) -> (u64, ExpectedPairs) {
    let is_flat = |t: &[u32; 3]| normal(t.map(|v| vertices[v as usize].map(i128::from))) == [0; 3];
    let mut found = ExpectedPairs::default();
    for (i, s) in triangles.iter().enumerate().filter(|(_, s)| !is_flat(s)) {
        for (j, t) in triangles.iter().enumerate().skip(i + 1).filter(|(_, t)| !is_flat(t)) {
            let Some(meeting) = meeting(vertices, *s, *t) else { continue };
            *match meeting {
                Meeting::Crossing => &mut found.crossing,
                Meeting::Overlapping => &mut found.overlapping,
                Meeting::Touching => &mut found.touching,
            } += 1;
            found.pairs.push(([i as u32, j as u32], meeting));
        }
    }
    (triangles.iter().filter(|t| is_flat(t)).count() as u64, found)
}

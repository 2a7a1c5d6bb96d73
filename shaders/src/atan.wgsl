// The angle of a vector; twin of `winding/open/atan.rs`, in single precision, four at a time.

// The distance of floats above 1: additions and products are off by at most so much of the result, whichever way the
// device rounds, quotients by 2.5 and inverse roots by 2 times as much (Vulkan's table of precisions).
const ULP: f32 = 1.0 / 8388608.0;

// Numbers, and bounds on their errors.
struct Bounded {
    value: vec4<f32>,
    error: vec4<f32>,
}

// The angles of (x, y) for y >= 0, in 0..=π, not of the zero vector.
//
// With t = y/x in 0..=1 and c the nearest quarter, atan t = atan c + atan z with z = (t - c)/(1 + tc), |z| <= 1/8; the
// series of atan z to z^9 leaves z^11/11. For c = 0, z is a quotient, 2.5 ULP off, and what follows adds less than 2;
// otherwise z is off by at most 1.5 ULP of 1, the steps, sums and folds add 8.
fn angle_of(y: vec4<f32>, x: vec4<f32>) -> Bounded {
    let beside = abs(x);
    let small = min(y, beside);
    let large = max(y, beside);
    // Not a loop: its steps would count as the caller's (see STEPS_MAX).
    let eighths = 8.0 * small;
    var c = vec4(0.0);
    var base = vec4(0.0);
    c = select(c, vec4(0.25), eighths >= large);
    base = select(base, vec4(0.24497866), eighths >= large);
    c = select(c, vec4(0.5), eighths >= 3.0 * large);
    base = select(base, vec4(0.46364761), eighths >= 3.0 * large);
    c = select(c, vec4(0.75), eighths >= 5.0 * large);
    base = select(base, vec4(0.64350111), eighths >= 5.0 * large);
    c = select(c, vec4(1.0), eighths >= 7.0 * large);
    base = select(base, vec4(0.78539816), eighths >= 7.0 * large);
    let z = (small - c * large) / (large + c * small);
    let s = z * z;
    let series = -1.0 / 3.0 + s * (1.0 / 5.0 + s * (-1.0 / 7.0 + s * (1.0 / 9.0)));
    let first = base + (z + z * (s * series));
    let is_plain = (y <= beside) & (x >= vec4(0.0)) & (c == vec4(0.0));
    let quarter = select(1.5707963 - first, first, y <= beside);
    let angle = select(quarter, 3.1415927 - quarter, x < vec4(0.0));
    return Bounded(angle, ULP * select(vec4(12.0), 6.0 * first, is_plain));
}

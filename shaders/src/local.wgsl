// The polynomial of what is far from a block; twin of `winding/open/local.rs`, in single precision. The host bounds its
// error, and adds the constant.

// By block: in falling powers of z, y, x that add up to less than DEGREE.
@group(0) @binding(4) var<storage, read> coefficients: array<f32>;

// The values of a block's polynomial at four positions with the same y and z, given in units of its radius.
fn polynomial(block: u32, x: vec4<f32>, y: f32, z: f32) -> vec4<f32> {
    var at = block * COEFFICIENTS;
    var value = vec4(0.0);
    for (var k = 0u; k < DEGREE; k++) {
        var plane = vec4(0.0);
        for (var j = 0u; j <= k; j++) {
            var line = vec4(0.0);
            for (var i = 0u; i <= j; i++) {
                line = line * x + coefficients[at];
                at++;
            }
            plane = plane * y + line;
        }
        value = value * z + plane;
    }
    return value;
}

// Pixels of what rays have gathered; twin of `render/frame.rs`.

// By tile, row by row: the colour, and the bits of the distance of the nearest opaque thing.
@group(0) @binding(12) var<storage, read_write> pixels: array<vec2<u32>>;

fn byte(c: f32) -> u32 {
    return u32(clamp(c + 0.5, 0.0, 255.0));
}

// One ray's colour in front of the background.
fn over_background(ray: u32) -> vec4<u32> {
    let seen = light[ray];
    let share = sight.background.w * (1.0 - seen.w);
    let opacity = seen.w + share;
    if opacity <= 0.0 { return vec4(0u); }
    let colour = (seen.xyz + sight.background.xyz * share) / opacity;
    return vec4(byte(colour.x), byte(colour.y), byte(colour.z), byte(opacity * 255.0));
}

@compute @workgroup_size(WORKGROUP)
fn blend(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) n: u32) {
    let rays = sight.rays * sight.rays;
    var sum = vec4(0u);
    var nearest = FAR;
    for (var part = 0u; part < rays; part++) {
        let ray = (tile.x * rays + part) * (TILE * TILE) + n;
        let colour = over_background(ray);
        sum += vec4(colour.xyz * colour.w, colour.w);
        nearest = min(nearest, along[ray].y);
    }
    // The mean, each with the weight of its opacity.
    let mean = (sum.xyz + sum.w / 2u) / max(sum.w, 1u);
    let opacity = (sum.w + rays / 2u) / rays;
    let at = pixel_of(0u, n) % TILE;
    pixels[tile.x * TILE * TILE + at.y * TILE + at.x] =
        vec2(mean.x | mean.y << 8u | mean.z << 16u | opacity << 24u, bitcast<u32>(nearest));
}

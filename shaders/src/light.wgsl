// What light makes of surfaces, and what of it a ray gathers; twin of `render/light.rs`.

struct Shell {
    colour: vec4<f32>,
    w: f32,
    least: f32,
    opacity: f32,
    rim: f32,
    flags: u32,
    unused: array<u32, 3>,
}

@group(0) @binding(1) var<storage, read> shells: array<Shell>;

// Light that has come along a ray so far: colours times opacity, and opacity.
var<private> gathered: vec4<f32>;

// Puts something behind what is there.
fn add(colour: vec3<f32>, opacity: f32) {
    let share = opacity * (1.0 - gathered.w);
    gathered += vec4(colour, 1.0) * share;
}

// Whether nothing behind would show.
fn is_full() -> bool {
    return gathered.w > 0.995;
}

fn is_opaque(number: u32) -> bool {
    return (shells[number].flags & OPAQUE) != 0u;
}

// The colour of a winding number.
fn colour_of(w: i32) -> vec3<f32> {
    return tables[PALETTE_AT + u32(clamp(w, -1, 6) + 1)].xyz;
}

// A matt surface with some gloss.
fn shaded(colour: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let half = max(dot(normal, sight.half.xyz), 0.0);
    let square = half * half;
    let fourth = square * square;
    let eighth = fourth * fourth;
    let gloss = 255.0 * sight.lighting.w * eighth * eighth * eighth;
    let key = max(dot(normal, sight.key.xyz), 0.0);
    let fill = max(dot(normal, sight.fill.xyz), 0.0);
    return colour * (sight.lighting.x + sight.lighting.y * key + sight.lighting.z * fill) + gloss;
}

// Colour and opacity of a surface with an outward normal, `most` being the largest winding number beside it.
fn surface_of(number: u32, most: i32, normal: vec3<f32>) -> vec4<f32> {
    let shell = shells[number];
    // Not quite as in sections, so that gloss shows on the darkest and shade on the palest.
    var colour = select(shell.colour.xyz, colour_of(most) * 0.95 + 8.0, (shell.flags & COUNTED) != 0u);
    let facing = dot(normal, sight.towards.xyz);
    if (shell.flags & SHADED) != 0u {
        // What is transparent is seen from within, too.
        let is_turned = facing < 0.0 && !is_opaque(number);
        colour = shaded(colour, select(normal, -normal, is_turned));
    }
    let edge = 1.0 - min(abs(facing), 1.0);
    return vec4(colour, min(shell.opacity + shell.rim * edge * edge * edge, 1.0));
}

// Where a cut opens the part: the colour of w, less light on the sides that face away.
fn cap(w: i32, normal: vec3<f32>) -> vec3<f32> {
    return colour_of(w) * (0.8 + 0.2 * abs(dot(normal, sight.towards.xyz)));
}

// Part of a haze, darker where w rises across the line of sight.
fn hazy(colour: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let light = 0.55 + 0.45 * abs(dot(normal, sight.towards.xyz));
    return colour * select(light, 1.0, all(normal == vec3(0.0)));
}

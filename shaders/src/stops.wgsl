// Functions of w by a few values; twin of `render/stops.rs`.

// Colours by winding number, then stops: w and the value there.
@group(0) @binding(2) var<storage, read> tables: array<vec4<f32>>;

// As many of the 256 entries from `first` on as have no larger w than this. Not a loop: steps of loops are few.
fn stops_before(first: u32, w: f32) -> u32 {
    var at = first;
    at += select(0u, 128u, tables[at + 127u].x <= w);
    at += select(0u, 64u, tables[at + 63u].x <= w);
    at += select(0u, 32u, tables[at + 31u].x <= w);
    at += select(0u, 16u, tables[at + 15u].x <= w);
    at += select(0u, 8u, tables[at + 7u].x <= w);
    at += select(0u, 4u, tables[at + 3u].x <= w);
    at += select(0u, 2u, tables[at + 1u].x <= w);
    at += select(0u, 1u, tables[at].x <= w);
    let is_beyond = at == first + 255u && tables[first + 255u].x <= w;
    return at - first + select(0u, 1u, is_beyond);
}

// The function with `count` stops from `first` on, at w: straight in between, level beyond.
fn stops_at(first: u32, count: u32, w: f32) -> vec3<f32> {
    let after = stops_before(first, w);
    let low = tables[first + max(after, 1u) - 1u];
    let high = tables[first + min(after, count - 1u)];
    let rise = high.x - low.x;
    let part = select(0.0, max((w - low.x) / rise, 0.0), rise > 0.0);
    return low.yzw + (high.yzw - low.yzw) * part;
}

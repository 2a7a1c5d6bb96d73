// Four samples in a row.

struct Row {
    x: vec4<i32>,
    y: i32,
    z: i32,
}

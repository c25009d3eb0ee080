// What rows have left.
@group(1) @binding(2) var<storage, read> rows: array<f32>;
@group(1) @binding(5) var<storage, read_write> result: array<f32>;

fn seen(at: u32) -> f32 {
    return rows[at];
}

@group(0) @binding(BINDING) var<storage, read> values_SLAB: array<f32>;

fn row_SLAB(o: u32, j: u32, k: u32) -> vec4f {
    let a = o + j * params.row + k * params.layer;
    return vec4f(values_SLAB[a], values_SLAB[a + 1u], values_SLAB[a + 2u], values_SLAB[a + 3u]);
}


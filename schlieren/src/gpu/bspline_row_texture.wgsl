// Four coefficients along x in each texel, so that a row is one read. Coefficients are there four
// times: a driver on the CPU reads buffers number by number, and this is what it takes to make its
// reads wide.
@group(0) @binding(BINDING) var rows: texture_2d_array<f32>;

fn row_SLAB(o: vec3u, j: u32, k: u32) -> vec4f {
    return textureLoad(rows, vec2u(o.x, o.y + j), o.z + k, 0);
}


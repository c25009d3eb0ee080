// Trilinear eps and its gradient from slab SLAB. `o` is the cell's first node there.
@group(0) @binding(BINDING) var<storage, read> values_SLAB: array<f32>;

fn sample_SLAB(o: u32, fraction: vec3f) -> vec4f {
    let r = o + params.row;
    let l = o + params.layer;
    let lr = l + params.row;
    // The cell's edges along x, at (y, z) = (0, 0), (1, 0), (0, 1), (1, 1).
    let near = vec4f(values_SLAB[o], values_SLAB[r], values_SLAB[l], values_SLAB[lr]);
    let far = vec4f(
        values_SLAB[o + 1u], values_SLAB[r + 1u], values_SLAB[l + 1u], values_SLAB[lr + 1u],
    );
    // Differences come first, so that the gradient is not a difference of interpolated values.
    let d = far - near;
    let e = fma(vec4f(fraction.x), d, near);
    let dy = e.yw - e.xz;
    let on_y = fma(vec2f(fraction.y), dy, e.xz);
    let dx = fma(vec2f(fraction.y), d.yw - d.xz, d.xz);
    let dz = on_y.y - on_y.x;
    return vec4f(
        fma(fraction.z, dx.y - dx.x, dx.x),
        fma(fraction.z, dy.y - dy.x, dy.x),
        dz,
        fma(fraction.z, dz, on_y.x),
    );
}

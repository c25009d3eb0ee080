// Central differences of eps and eps itself, stored at the nodes of slab SLAB, between these. `o`
// is the cell's first node there.
@group(0) @binding(BINDING) var<storage, read> nodes_SLAB: array<vec4f>;

// Between two neighbours along x.
fn edge_SLAB(o: u32, x: f32) -> vec4f {
    let near = nodes_SLAB[o];
    return fma(vec4f(x), nodes_SLAB[o + 1u] - near, near);
}

fn sample_SLAB(o: u32, fraction: vec3f) -> vec4f {
    let l = o + params.layer;
    let a = edge_SLAB(o, fraction.x);
    let b = edge_SLAB(o + params.row, fraction.x);
    let c = edge_SLAB(l, fraction.x);
    let d = edge_SLAB(l + params.row, fraction.x);
    let low = fma(vec4f(fraction.y), b - a, a);
    let high = fma(vec4f(fraction.y), d - c, c);
    return fma(vec4f(fraction.z), high - low, low);
}

// Kinds of the nodes, sixteen per word, two bits each: 0 gas, 1 blank, 2 solid.
@group(0) @binding(3) var<storage, read> kinds: array<u32>;

// The kind of the nearest node.
fn node_kind(at: vec3f) -> u32 {
    let inside = min(max(at, vec3f(0.0)), params.last);
    let near = vec3u(inside + vec3f(0.5));
    let o = near.x + params.dims.x * (near.y + params.dims.y * near.z);
    return (kinds[o >> 4u] >> ((o & 15u) * 2u)) & 3u;
}

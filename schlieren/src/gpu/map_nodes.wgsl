// Kinds of the worst nodes along rays through the nodes of a map, packed as in nodes.wgsl.
@group(0) @binding(3) var<storage, read> kinds: array<u32>;

// The kind of the nearest node of the map.
fn map_node_kind(at: vec2f) -> u32 {
    let near = vec2u(clamp(at + vec2f(0.5), vec2f(0.0), projection.last));
    let o = near.x + (u32(projection.last.x) + 1u) * near.y;
    return (kinds[o >> 4u] >> ((o & 15u) * 2u)) & 3u;
}

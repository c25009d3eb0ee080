// The property PROPERTY of the medium, trilinear and constant beyond its outermost nodes, at a
// place of the field's lattice.
@group(1) @binding(BINDING) var<storage, read> values_of_property_PROPERTY: array<f32>;

fn property_PROPERTY(place: vec3f) -> f32 {
    let dims = media.dims[PROPERTY].xyz;
    let scaled = fma(place, media.scale[PROPERTY].xyz, media.offset[PROPERTY].xyz);
    let at = clamp(scaled, vec3f(0.0), vec3f(dims - 1u));
    let cell = min(vec3u(at), dims - 2u);
    let t = at - vec3f(cell);
    let row = dims.x;
    let layer = dims.x * dims.y;
    let o = cell.x + cell.y * row + cell.z * layer;
    let near = vec4f(
        values_of_property_PROPERTY[o],
        values_of_property_PROPERTY[o + row],
        values_of_property_PROPERTY[o + layer],
        values_of_property_PROPERTY[o + layer + row],
    );
    let far = vec4f(
        values_of_property_PROPERTY[o + 1u],
        values_of_property_PROPERTY[o + row + 1u],
        values_of_property_PROPERTY[o + layer + 1u],
        values_of_property_PROPERTY[o + layer + row + 1u],
    );
    let on_x = fma(vec4f(t.x), far - near, near);
    let on_y = fma(vec2f(t.y), on_x.yw - on_x.xz, on_x.xz);
    return fma(t.z, on_y.y - on_y.x, on_y.x);
}

// The spline of the map MAP: its value, and its derivatives along right and up.
@group(0) @binding(BINDING) var<storage, read> MAP_coefficients: array<f32>;

fn MAP_row(first: u32) -> vec4f {
    return vec4f(
        MAP_coefficients[first],
        MAP_coefficients[first + 1u],
        MAP_coefficients[first + 2u],
        MAP_coefficients[first + 3u],
    );
}

fn sample_MAP(c: MapCell) -> vec3f {
    let row = projection.row;
    return spline_of_rows(
        c,
        MAP_row(c.first),
        MAP_row(c.first + row),
        MAP_row(c.first + 2u * row),
        MAP_row(c.first + 3u * row),
    );
}

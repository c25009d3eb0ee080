// The deflection along SIDE, from a map of its own.
@group(0) @binding(BINDING) var<storage, read> SIDE_coefficients: array<f32>;

fn SIDE_row(first: u32) -> vec4f {
    return vec4f(
        SIDE_coefficients[first],
        SIDE_coefficients[first + 1u],
        SIDE_coefficients[first + 2u],
        SIDE_coefficients[first + 3u],
    );
}

fn SIDE_slope(c: MapCell) -> f32 {
    let row = projection.row;
    return spline_of_rows(
        c,
        SIDE_row(c.first),
        SIDE_row(c.first + row),
        SIDE_row(c.first + 2u * row),
        SIDE_row(c.first + 3u * row),
    ).x;
}

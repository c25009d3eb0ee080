// Straight rays: march/line_of_sight.rs in WGSL. The field is projected along the light, and a ray
// samples its path and deflection from splines over the plane across it.
//
// The host adds `const OPD` and `const OBLIQUE`, and of map.wgsl `sample_path`, and for oblique
// views `sample_right` and `sample_up`, which are without effect along an axis.

struct Projection {
    // Map coordinate of the view's centre, and map steps per metre, as high and low parts.
    centre: vec2f,
    centre_low: vec2f,
    per_m: vec2f,
    per_m_low: vec2f,
    // The last node along right and up.
    last: vec2f,
    row: u32,
    // Distance from the plane through the view's centre to the exit, where OBLIQUE is false.
    exit_depth_m: f32,
}

@group(0) @binding(PROJECTION_BINDING) var<uniform> projection: Projection;

// A cell of the map, as the first of its 4 x 4 coefficients, and the weights of these.
struct MapCell {
    first: u32,
    along_right: vec4f,
    along_up: vec4f,
    // Of the differences of neighbours, for the derivative.
    right_differences: vec3f,
    up_differences: vec3f,
}

fn map_cell(at: vec2f) -> MapCell {
    let inside = min(max(at, vec2f(0.0)), projection.last);
    let cell = vec2u(min(inside, projection.last - vec2f(1.0)));
    let t = inside - vec2f(cell);
    let s = vec2f(1.0) - t;
    let t2 = t * t;
    let s2 = s * s;
    let w0 = s2 * s * (1.0 / 6.0);
    let w1 = fma(fma(t, vec2f(0.5), vec2f(-1.0)), t2, vec2f(2.0 / 3.0));
    let w2 = fma(fma(s, vec2f(0.5), vec2f(-1.0)), s2, vec2f(2.0 / 3.0));
    let w3 = t2 * t * (1.0 / 6.0);
    let d0 = s2 * 0.5;
    let d1 = fma(t, s, vec2f(0.5));
    let d2 = t2 * 0.5;
    return MapCell(
        cell.x + cell.y * projection.row,
        vec4f(w0.x, w1.x, w2.x, w3.x),
        vec4f(w0.y, w1.y, w2.y, w3.y),
        vec3f(d0.x, d1.x, d2.x),
        vec3f(d0.y, d1.y, d2.y),
    );
}

// A spline's value (x), and its derivatives per map step along right (y) and up (z), from rows of
// four coefficients.
fn spline_of_rows(c: MapCell, a: vec4f, b: vec4f, d: vec4f, e: vec4f) -> vec3f {
    let up = c.along_up;
    let value = fma(vec4f(up.w), e, fma(vec4f(up.z), d, fma(vec4f(up.y), b, up.x * a)));
    let h = c.up_differences;
    let along_up = fma(vec4f(h.z), e - d, fma(vec4f(h.y), d - b, h.x * (b - a)));
    let w = c.along_right;
    let dx = value.yzw - value.xyz;
    let g = c.right_differences;
    return vec3f(
        fma(w.w, value.w, fma(w.z, value.z, fma(w.y, value.y, w.x * value.x))),
        fma(g.z, dx.z, fma(g.y, dx.y, g.x * dx.x)),
        fma(w.w, along_up.w, fma(w.z, along_up.z, fma(w.y, along_up.y, w.x * along_up.x))),
    );
}

// The field is not on the device: rays that bend in it are marched.
fn sample(at: vec3f) -> vec4f {
    return vec4f(0.0);
}

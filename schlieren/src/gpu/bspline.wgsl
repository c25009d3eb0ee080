// Prefiltered cubic B-spline from slab SLAB. `o` is the first of the 4x4x4 coefficients there.
//
// The host adds `row_SLAB`: four coefficients along x, j rows and k layers after `o`.
fn sample_SLAB(o: ORIGIN, fraction: vec3f) -> vec4f {
    // Weights of the four coefficients along each axis, and of their three differences for the
    // derivative.
    let s = vec3f(1.0) - fraction;
    let t2 = fraction * fraction;
    let s2 = s * s;
    let w0 = s2 * s * (1.0 / 6.0);
    let w1 = fma(fma(fraction, vec3f(0.5), vec3f(-1.0)), t2, vec3f(2.0 / 3.0));
    let w2 = fma(fma(s, vec3f(0.5), vec3f(-1.0)), s2, vec3f(2.0 / 3.0));
    let w3 = t2 * fraction * (1.0 / 6.0);
    let d0 = s2 * 0.5;
    let d1 = fma(fraction, s, vec3f(0.5));
    let d2 = t2 * 0.5;
    let wy = vec4f(w0.y, w1.y, w2.y, w3.y);
    let dy = vec4f(0.0, d0.y, d1.y, d2.y);

    // Sum along z and y, row by row. This leaves four numbers along x for each of value, y and z
    // derivative.
    var value = vec4f(0.0);
    var along_y = vec4f(0.0);
    var along_z = vec4f(0.0);
    var before = vec4f(0.0);
    for (var j = 0u; j < 4u; j++) {
        let ca = row_SLAB(o, j, 0u);
        let cb = row_SLAB(o, j, 1u);
        let cc = row_SLAB(o, j, 2u);
        let cd = row_SLAB(o, j, 3u);
        let on_z = fma(vec4f(w3.z), cd, fma(vec4f(w2.z), cc, fma(vec4f(w1.z), cb, w0.z * ca)));
        let dz = fma(vec4f(d2.z), cd - cc, fma(vec4f(d1.z), cc - cb, d0.z * (cb - ca)));
        value = fma(vec4f(wy[j]), on_z, value);
        along_z = fma(vec4f(wy[j]), dz, along_z);
        if j > 0u {
            along_y = fma(vec4f(dy[j]), on_z - before, along_y);
        }
        before = on_z;
    }

    // Sum along x.
    let wx = vec4f(w0.x, w1.x, w2.x, w3.x);
    let dx = value.yzw - value.xyz;
    return vec4f(
        fma(d2.x, dx.z, fma(d1.x, dx.y, d0.x * dx.x)),
        weighted(wx, along_y),
        weighted(wx, along_z),
        weighted(wx, value),
    );
}

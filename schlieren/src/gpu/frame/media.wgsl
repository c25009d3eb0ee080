// What the medium does to a photon's light on its way: absorption, and rotation in front of an
// analyser. This is media/paraxial.rs in WGSL, with compensated sums for the host's f64.
//
// The host adds `const ABSORPTION`, `const ROTATION`, `const ANALYSER`, `const BENT`, and
// `property_0` (absorption) and `property_1` (rotation), each the property at a place of the
// field's lattice.

struct Media {
    // Longest step, as high and low part.
    step_voxels: vec2f,
    // Cosine and sine of the analyser's angle.
    analyser: vec2f,
    // A property's lattice coordinates are those of the field times `scale` plus `offset`.
    scale: array<vec4f, 2>,
    offset: array<vec4f, 2>,
    // Number of nodes.
    dims: array<vec4u, 2>,
}

@group(1) @binding(7) var<uniform> media: Media;

// A sum, and what it lacks.
fn add_to(sum: vec2f, more: f32) -> vec2f {
    let term = more - sum.y;
    let next = rounded(sum.x + term);
    return vec2f(next, rounded(next - sum.x) - term);
}

// Sine and cosine of any angle: WGSL's own may be wrong by 2^-11.
fn sin_cos(angle: f32) -> vec2f {
    let quarters = round(angle * 0.63661977);
    // Pi/2 in two parts.
    let rest = fma(quarters, -1.5707964, angle) + quarters * 4.371139e-8;
    let sc = sin_cos_to_45_degrees(rest);
    let quadrant = i32(quarters) & 3;
    let turned = select(sc, vec2f(sc.y, -sc.x), (quadrant & 1) != 0);
    return select(turned, -turned, (quadrant & 2) != 0);
}

// The part of the light that is left.
fn passes_medium(image_point_m: vec2f, tilt: vec2f) -> f32 {
    let ray = undisturbed_in_steps(image_point_m, tilt, media.step_voxels).ray;
    var xi = ray.xi;
    var v = vec3f(0.0);
    var depth = vec2f(0.0);
    var rotation = vec2f(0.0);
    let step_m = ray.dt * frame.unit_m;
    let middle = 0.5 * f32(ray.steps);
    for (var k = 0u; k < ray.steps; k++) {
        var at = fma(vec3f(f32(k) + 0.5 - middle), ray.stride, ray.middle) + xi;
        var length_m = step_m;
        if BENT {
            // One leapfrog step over depth.
            at = fma(vec3f(0.5 * ray.dt), v, at);
            let here = sample(at);
            let g = here.xyz * params.rcp_h2;
            let g_z = dot(g, ray.along);
            let square = dot(v * params.h2, v);
            let push = ray.dt * (square + 1.0) / (here.w + 1.0);
            // The gradient across the ray, in lattice steps.
            let across = (here.xyz - ray.along * g_z) * params.rcp_h2;
            let next = fma(vec3f(push), across - v * g_z, v);
            let mean = 0.5 * (v + next);
            length_m *= sqrt(1.0 + dot(mean * params.h2, mean));
            xi = fma(vec3f(ray.dt), mean, xi);
            v = next;
        }
        if ABSORPTION {
            depth = add_to(depth, property_0(at) * length_m);
        }
        if ROTATION {
            rotation = add_to(rotation, property_1(at) * length_m);
        }
    }
    var left = 1.0;
    if ABSORPTION {
        left = exp(-depth.x);
    }
    if ANALYSER {
        // cos(a - r) of the analyser's angle and the rotation.
        let sc = sin_cos(rotation.x);
        let cosine = media.analyser.x * sc.y + media.analyser.y * sc.x;
        left *= cosine * cosine;
    }
    // Absorbed light stays above 0, however weak: its ray arrives.
    return max(left, 1.1754944e-38);
}

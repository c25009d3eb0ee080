// A filter given as an image (cutoff/image.rs). technique[0]: its size in metres and in pixels.

// Red, green and blue of its pixels, row by row from the top.
@group(1) @binding(3) var<storage, read> filter_image: array<f32>;

fn filter_pixel(at: vec2u) -> vec3f {
    let size = vec2u(frame.technique[0].zw);
    let inside = min(at, size - 1u);
    let o = 3u * (inside.y * size.x + inside.x);
    return vec3f(filter_image[o], filter_image[o + 1u], filter_image[o + 2u]);
}

fn transmission(at_m: vec2f) -> vec3f {
    let part = vec2f(0.5) + vec2f(at_m.x, -at_m.y) / frame.technique[0].xy;
    let at = clamp(part * frame.technique[0].zw - 0.5, vec2f(0.0), frame.technique[0].zw - 1.0);
    let first = vec2u(at);
    let f = at - floor(at);
    let above = mix(filter_pixel(first), filter_pixel(first + vec2u(1u, 0u)), f.x);
    let below = mix(filter_pixel(first + vec2u(0u, 1u)), filter_pixel(first + 1u), f.x);
    return mix(above, below, f.y);
}

fn averaged(at_m: vec2f) -> vec3f {
    return transmission(at_m);
}

// A knife's edge (cutoff/knife.rs). technique[0]: direction of the opening, distance of the edge;
// technique[1]: half-lengths of the source's sides across the edge, the longer first, or its radius.

fn distance_to_edge(at_m: vec2f) -> f32 {
    return dot(frame.technique[0].xy, at_m) - frame.technique[0].z;
}

fn transmission(at_m: vec2f) -> vec3f {
    let d = distance_to_edge(at_m);
    return vec3f(select(select(0.0, 1.0, d > 0.0), 0.5, d == 0.0));
}

fn averaged(at_m: vec2f) -> vec3f {
    let d = distance_to_edge(at_m);
    let p = frame.technique[1].x;
    let q = frame.technique[1].y;
    if OPEN == 0u {
        return transmission(at_m);
    }
    if OPEN == 1u {
        return vec3f(clamp(0.5 + 0.5 * d / p, 0.0, 1.0));
    }
    if OPEN == 2u {
        let t = clamp(d, -p - q, p + q);
        if abs(t) <= p - q {
            return vec3f(0.5 + 0.5 * t / p);
        }
        let beyond = p + q - abs(t);
        let corner = beyond * beyond / (8.0 * p * q);
        return vec3f(select(corner, 1.0 - corner, t > 0.0));
    }
    // A segment of a disc; its angle from the axis is the arcsine.
    let x = clamp(d / p, -1.0, 1.0);
    let across = sqrt((1.0 - x) * (1.0 + x));
    return vec3f(0.5 + (x * across + arctangent(x, across)) / 3.1415927);
}

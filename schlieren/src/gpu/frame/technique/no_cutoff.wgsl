// Schlieren without a cut-off.

fn transmission(at_m: vec2f) -> vec3f {
    return vec3f(1.0);
}

fn averaged(at_m: vec2f) -> vec3f {
    return vec3f(1.0);
}

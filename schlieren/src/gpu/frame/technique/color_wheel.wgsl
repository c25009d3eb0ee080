// A colour wheel (cutoff/color.rs). technique[0]: radius of full saturation, direction of red in
// sixths of a turn.

fn peak(h: f32, center: f32) -> f32 {
    let d = abs(h - center);
    return clamp(2.0 - min(d, 6.0 - d), 0.0, 1.0);
}

fn transmission(at_m: vec2f) -> vec3f {
    let saturation = min(length(at_m) / frame.technique[0].x, 1.0);
    let turn = arctangent(at_m.y, at_m.x) * (3.0 / 3.1415927) - frame.technique[0].y;
    let h = turn - 6.0 * floor(turn / 6.0);
    let pure = vec3f(peak(h, 0.0), peak(h, 2.0), peak(h, 4.0));
    return 1.0 + saturation * (pure - 1.0);
}

fn averaged(at_m: vec2f) -> vec3f {
    return transmission(at_m);
}

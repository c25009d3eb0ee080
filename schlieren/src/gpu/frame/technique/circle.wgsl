// A circle or its complement (cutoff/circle.rs). technique[0]: centre, radius, 1 where the inside
// passes and 0 where the outside does; technique[1]: radius of the source.

fn passes(inside: f32) -> vec3f {
    return vec3f(select(1.0 - inside, inside, frame.technique[0].w > 0.5));
}

fn transmission(at_m: vec2f) -> vec3f {
    let d = length(at_m - frame.technique[0].xy);
    return passes(select(0.0, 1.0, d <= frame.technique[0].z));
}

// Segment of a disc of radius r: the chord is `half` wide on each side, `to_chord` from the centre.
// The angle minus the product of its sine and cosine cancels for small ones; the series does not.
fn segment(r: f32, half: f32, to_chord: f32) -> f32 {
    let angle = arctangent(half, to_chord);
    if angle < 0.5 {
        let z = 4.0 * angle * angle;
        let series = 1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0 - z / 362880.0));
        return 0.5 * r * r * z * 2.0 * angle * series;
    }
    return r * r * (angle - half * to_chord / (r * r));
}

fn averaged(at_m: vec2f) -> vec3f {
    let d = length(at_m - frame.technique[0].xy);
    let r = frame.technique[0].z;
    let s = frame.technique[1].x;
    let whole = 3.1415927 * s * s;
    if d >= r + s {
        return passes(0.0);
    }
    if d <= abs(r - s) {
        let small = min(r, s);
        return passes(3.1415927 * small * small / whole);
    }
    // Heron's formula. Tiny distances keep their digits, and their squares would be zero.
    let relative = max((d - (r - s)) / d, 0.0) * max((d + (r - s)) / d, 0.0);
    let half = 0.5 * sqrt((r + s - d) * (r + s + d) * relative);
    let chord = (d * d + (r - s) * (r + s)) / (2.0 * d);
    return passes((segment(r, half, chord) + segment(s, half, d - chord)) / whole);
}

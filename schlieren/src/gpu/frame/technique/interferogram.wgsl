// Interference with a reference beam (technique/interferogram.rs). technique[0]: waves per metre,
// fringes per metre along right, each as high and low part; technique[1]: those along up,
// visibility.
fn technique_energy(photon: Photon) -> vec3f {
    let at_x = two_sum(photon.position_m.x, photon.shift_m.x);
    let at_y = two_sum(photon.position_m.y, photon.shift_m.y);
    let carrier = sum(
        product(frame.technique[0].zw, at_x),
        product(frame.technique[1].xy, at_y),
    );
    let waves = sum(times(frame.technique[0].xy, photon.path_m), carrier);
    // Quarters of a wave, so that the rest is within 45 degrees.
    let quarters = whole_to(sum(waves * 4.0, vec2f(0.5, 0.0)));
    let rest = sum(waves, vec2f(-0.25 * quarters, 0.0)).x;
    let sc = sin_cos_to_45_degrees(6.2831853 * rest);
    let quadrant = quarters - 4.0 * floor(0.25 * quarters);
    var cosine = sc.y;
    if quadrant == 1.0 {
        cosine = -sc.x;
    } else if quadrant == 2.0 {
        cosine = -sc.y;
    } else if quadrant == 3.0 {
        cosine = sc.x;
    }
    return vec3f(0.5 + 0.5 * frame.technique[1].z * cosine);
}

// Schlieren: what the cut-off plane passes. The host adds `transmission` of a point and `averaged`
// over the source image, of the cut-off that the scene has.
fn technique_energy(photon: Photon) -> vec3f {
    let at_m = photon.image_point_m + frame.schlieren_focal_length_m * photon.deflection_rad;
    var passed: vec3f;
    if AVERAGED {
        passed = averaged(at_m);
    } else {
        passed = transmission(at_m);
    }
    if BAND {
        // A coloured filter at one wavelength of several.
        return vec3f(dot(frame.technique[3].xyz, passed));
    }
    return passed;
}

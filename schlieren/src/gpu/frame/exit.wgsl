// What a ray brings to the film: march/kernel_ray.rs and optics.rs in f32.

struct Photon {
    // Start in the plane through the view's centre.
    position_m: vec2f,
    // The image of its source point in the cut-off plane.
    image_point_m: vec2f,
    deflection_rad: vec2f,
    // From its start to where it lands, in the plane of focus.
    shift_m: vec2f,
    // Optical path difference on the film; 0 if the technique does not need it.
    path_m: f32,
    // The worst node that it met.
    worst_node: u32,
    steps: u32,
    // The part of its light that the medium leaves.
    left: f32,
}

// Components of a deviation along the right and up of a ray's own beam, whose frame is the view's
// turned by the smallest rotation: with the direction (a, b, c) in the view's axes, right becomes
// (1 - a^2/(1+c), -ab/(1+c), -a).
fn across_beam(deviation: vec3f, tilt: vec2f) -> vec2f {
    let plain = vec2f(dot(deviation, frame.right), dot(deviation, frame.up));
    if TILTED_BEAMS {
        let c = inverseSqrt(1.0 + dot(tilt, tilt));
        let ab = tilt * c;
        let turned = plain - ab * (dot(ab, plain) / (1.0 + c) + dot(deviation, frame.forward));
        return vec2f(frame.mirror * turned.x, turned.y);
    }
    return vec2f(frame.mirror * plain.x, plain.y);
}

fn trace(position_m: vec2f, image_point_m: vec2f) -> Photon {
    var photon: Photon;
    photon.position_m = position_m;
    photon.image_point_m = image_point_m;
    var tilt = vec2f(0.0);
    if TILTED_BEAMS {
        tilt = image_point_m / frame.schlieren_focal_length_m;
    }
    let start = undisturbed(position_m, tilt);
    let out = march_ray(start.ray);
    photon.worst_node = out.worst_node;
    photon.steps = start.ray.steps;
    let v = out.v * frame.spacing * start.scale;
    let xi = (out.xi - start.ray.xi) * frame.spacing * (start.scale * start.scale * frame.unit_m);
    let deflection = across_beam(v, start.tilt);
    var displacement_m = across_beam(xi, start.tilt);
    if start.ray.steps == 0u {
        displacement_m = vec2f(0.0);
    }
    photon.deflection_rad = deflection;
    // Deflections are sines.
    let lever_m = frame.focus_m - start.exit_depth_m;
    let sine2 = dot(deflection, deflection);
    let cosine = sqrt(max(1.0 - sine2, 1.1754944e-38));
    photon.shift_m =
        tilt * frame.focus_m + (displacement_m + deflection * (lever_m / cosine));
    if OPD {
        photon.path_m = out.opd * start.scale * frame.unit_m * frame.n0
            + frame.n0 * lever_m * sine2 / (cosine * (1.0 + cosine));
    }
    photon.left = 1.0;
    if MEDIA && !is_stopped(photon) {
        photon.left = passes_medium(position_m, tilt);
    }
    return photon;
}

// The point of the source image for a point of the unit square.
fn source_point(at: vec2f) -> vec2f {
    if SOURCE == 1u {
        let p = (2.0 * at - 1.0) * frame.source_half_m;
        let axis = frame.source_axis;
        return vec2f(p.x * axis.x - p.y * axis.y, p.x * axis.y + p.y * axis.x);
    }
    if SOURCE == 2u {
        return unit_disk(at) * frame.source_half_m.x;
    }
    return vec2f(0.0);
}

// Whether light ends in the field: at bodies, at places without data unless they are continued, or
// because it turns.
fn is_stopped(photon: Photon) -> bool {
    return photon.worst_node > params.survives;
}

// What a ray brings to the film: march/kernel_ray.rs and optics.rs in f32. `cross_flow` is in
// crossing_bent.wgsl or crossing_straight.wgsl.

// A ray's way through the flow, in the frame of the image.
struct Crossing {
    deflection_rad: vec2f,
    displacement_m: vec2f,
    // Optical path difference within the flow by the reference index; 0 if it is not wanted.
    path_m: f32,
    // Where the ray leaves the flow.
    exit_depth_m: f32,
    worst_node: u32,
    steps: u32,
}

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

fn trace(position_m: vec2f, image_point_m: vec2f) -> Photon {
    var photon: Photon;
    photon.position_m = position_m;
    photon.image_point_m = image_point_m;
    var tilt = vec2f(0.0);
    if TILTED_BEAMS {
        tilt = image_point_m / frame.schlieren_focal_length_m;
    }
    let crossing = cross_flow(position_m, tilt);
    photon.worst_node = crossing.worst_node;
    photon.steps = crossing.steps;
    photon.deflection_rad = crossing.deflection_rad;
    // Deflections are sines.
    let lever_m = frame.focus_m - crossing.exit_depth_m;
    let sine2 = dot(crossing.deflection_rad, crossing.deflection_rad);
    let cosine = sqrt(max(1.0 - sine2, 1.1754944e-38));
    photon.shift_m = tilt * frame.focus_m
        + (crossing.displacement_m + crossing.deflection_rad * (lever_m / cosine));
    if OPD {
        photon.path_m =
            crossing.path_m * frame.n0 + frame.n0 * lever_m * sine2 / (cosine * (1.0 + cosine));
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

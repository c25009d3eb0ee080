// A ray that is marched through the flow.

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

fn cross_flow(position_m: vec2f, tilt: vec2f) -> Crossing {
    let start = undisturbed(position_m, tilt);
    let out = march_ray(start.ray);
    let v = out.v * frame.spacing * start.scale;
    let xi = (out.xi - start.ray.xi) * frame.spacing * (start.scale * start.scale * frame.unit_m);
    var crossing: Crossing;
    crossing.deflection_rad = across_beam(v, start.tilt);
    crossing.displacement_m = across_beam(xi, start.tilt);
    if start.ray.steps == 0u {
        crossing.displacement_m = vec2f(0.0);
    }
    crossing.path_m = out.opd * start.scale * frame.unit_m;
    crossing.exit_depth_m = start.exit_depth_m;
    crossing.worst_node = out.worst_node;
    crossing.steps = start.ray.steps;
    return crossing;
}

// The rays of a frame: where they start, and where they enter and leave the field. This is
// march/frame.rs and march/kernel_ray.rs with numbers of 48 bits.

// A ray as its start and what the exit needs of it.
struct Undisturbed {
    ray: Ray,
    // Slopes of its beam along the view's right and up.
    tilt: vec2f,
    // The exact step divided by that of `ray`.
    scale: f32,
    exit_depth_m: f32,
}

// A point of the plane through the view's centre, from pixels, in metres along right and up. f32,
// as starts are everywhere.
fn plane_point(x_px: vec2f, y_px: vec2f) -> vec2f {
    let x = sum(frame.left_m, product(frame.pixel_m, x_px));
    let y = sum(frame.top_m, -product(frame.pixel_m, y_px));
    return vec2f(x.x, y.x);
}

// One coordinate of a ray on the lattice: through `at` in the middle plane, `along` per metre.
struct Line {
    at: vec2f,
    along: vec2f,
}

fn line(axis: u32, position: vec2f, tilt: vec2f, per_length: vec2f) -> Line {
    let centre = vec2f(frame.centre[axis], frame.centre_low[axis]);
    let right = vec2f(frame.right_steps[axis], frame.right_steps_low[axis]);
    let up = vec2f(frame.up_steps[axis], frame.up_steps_low[axis]);
    let forward = vec2f(frame.forward_steps[axis], frame.forward_steps_low[axis]);
    let at = sum(centre, sum(times(right, position.x), times(up, position.y)));
    if TILTED_BEAMS {
        let slope = sum(times(right, tilt.x), times(up, tilt.y));
        return Line(at, product(sum(forward, slope), per_length));
    }
    return Line(at, forward);
}

// Distances along the ray to two opposite faces. Written so that NaN is outside.
fn between(line: Line, last: f32, so_far: vec4f) -> vec4f {
    if line.along.x == 0.0 {
        if !less(line.at, vec2f(0.0)) && !less(vec2f(last, 0.0), line.at) {
            return so_far;
        }
        return vec4f(0.0);
    }
    let a = quotient(-line.at, line.along);
    let b = quotient(sum(vec2f(last, 0.0), -line.at), line.along);
    return vec4f(larger(so_far.xy, smaller(a, b)), smaller(so_far.zw, larger(a, b)));
}

// The ray that starts at a point of the plane, in the frame of the image.
fn undisturbed(image_point: vec2f, image_tilt: vec2f) -> Undisturbed {
    return undisturbed_in_steps(image_point, image_tilt, frame.step_voxels);
}

// That ray in steps of this length at most, as high and low part.
fn undisturbed_in_steps(image_point: vec2f, image_tilt: vec2f, step_voxels: vec2f) -> Undisturbed {
    let position = vec2f(frame.mirror * image_point.x, image_point.y);
    let tilt = vec2f(frame.mirror * image_tilt.x, image_tilt.y);
    var out: Undisturbed;
    out.tilt = tilt;
    out.scale = 1.0;
    var per_length = vec2f(1.0, 0.0);
    if TILTED_BEAMS {
        let squares = sum(two_product(tilt.x, tilt.x), two_product(tilt.y, tilt.y));
        per_length = inverse_root(sum(vec2f(1.0, 0.0), squares));
    }
    let x = line(0u, position, tilt, per_length);
    let y = line(1u, position, tilt, per_length);
    let z = line(2u, position, tilt, per_length);
    let far_away = 3.0e38;
    var range = vec4f(-far_away, 0.0, far_away, 0.0);
    range = between(x, params.last.x, range);
    range = between(y, params.last.y, range);
    range = between(z, params.last.z, range);
    if !less(range.xy, range.zw) || range.x == -far_away || range.z == far_away {
        return out;
    }
    let length_m = sum(range.zw, -range.xy);
    let half_way = sum(range.xy, range.zw) * 0.5;
    let chord = array(
        product(x.along, length_m), product(y.along, length_m), product(z.along, length_m),
    );
    let squares = sum(
        product(chord[0], chord[0]),
        sum(product(chord[1], chord[1]), product(chord[2], chord[2])),
    );
    // A tiny excess over a whole number is rounding and adds no step.
    let steps = product(quotient(root(squares), step_voxels), vec2f(1.0, -1e-12));
    let count = max(whole_from(steps), 1.0);
    let per_step = vec2f(count, 0.0);
    let middle = array(
        sum(x.at, product(x.along, half_way)),
        sum(y.at, product(y.along, half_way)),
        sum(z.at, product(z.along, half_way)),
    );
    out.ray.middle = vec3f(middle[0].x, middle[1].x, middle[2].x);
    out.ray.xi = vec3f(middle[0].y, middle[1].y, middle[2].y);
    out.ray.stride = vec3f(
        quotient(chord[0], per_step).x,
        quotient(chord[1], per_step).x,
        quotient(chord[2], per_step).x,
    );
    var along = frame.forward;
    if TILTED_BEAMS {
        along = (frame.forward + tilt.x * frame.right + tilt.y * frame.up) * per_length.x;
    }
    out.ray.along = along * frame.spacing;
    out.ray.steps = u32(count);
    // The unit is a power of two.
    let dt = quotient(length_m, per_step) / frame.unit_m;
    out.ray.dt = dt.x;
    out.scale = 1.0 + dt.y / dt.x;
    out.exit_depth_m = range.z;
    return out;
}

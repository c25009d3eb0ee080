// Sends photons: one invocation traces one photon and deposits it. A work group has a tile of
// 16 x 4 pixels in the pass `number`: neighbours along x read the same lines of memory.
//
// The host adds `const COUNTS` and `keep` (keep.wgsl, or without effect).

fn send(x: i32, y: i32, number: u32, ray: u32) {
    if is_behind_body(ray) {
        atomicAdd(&outcomes[BEHIND_BODY], 1u);
        return;
    }
    let key = pixel_key(frame.seed, u32(x), u32(y));
    let jitter = square(key, number, 0u);
    let position = plane_point(two_sum(f32(x), jitter.x), two_sum(f32(y), jitter.y));
    var image_point = vec2f(0.0);
    if SOURCE > 0u {
        image_point = source_point(square(key, number, 1u));
    }
    let photon = trace(position, image_point);
    atomicAdd(&outcomes[STEPS], photon.steps);
    if is_stopped(photon) {
        let turned = photon.worst_node == TURNED_BIT;
        atomicAdd(&outcomes[select(STOPPED, TURNED, turned)], 1u);
        return;
    }
    let energy = technique_energy(photon) * photon.left;
    var shift = photon.shift_m;
    if FROM_FILM {
        shift = vec2f(0.0);
    }
    if !is_finite(shift.x + shift.y + energy.x + energy.y + energy.z) {
        atomicAdd(&outcomes[NOT_A_NUMBER], 1u);
        return;
    }
    atomicAdd(&outcomes[LANDED], 1u);
    let at = vec2f(f32(x), f32(y)) + jitter + vec2f(shift.x, -shift.y) * frame.per_pixel_m;
    keep(frame.first_photon + ray, at, energy);
    let size = vec2f(f32(frame.width), f32(frame.height));
    if all(at >= vec2f(0.0)) && all(at < size) {
        let pixel = u32(at.y) * frame.width + u32(at.x);
        expose(number % frame.parts, pixel, energy);
        if COUNTS {
            atomicAdd(&film[frame.counts + pixel], 1u);
        }
        atomicAdd(&outcomes[ON_FILM], 1u);
    }
}

@compute @workgroup_size(64)
fn photons(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    clear_outcomes(lane);
    let tile = frame.first + group.x;
    let number = frame.first_pass + tile / frame.per_pass;
    let in_pass = tile % frame.per_pass;
    let x = in_pass % frame.per_row * 16u + lane % 16u;
    let y = in_pass / frame.per_row * 4u + lane / 16u;
    if x < frame.width + 2u * frame.margin && y < frame.height + 2u * frame.margin {
        send(i32(x) - i32(frame.margin), i32(y) - i32(frame.margin), number, 64u * group.x + lane);
    }
    add_outcomes(lane);
}

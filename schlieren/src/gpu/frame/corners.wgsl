// The corners of the cells of a beam: one invocation traces one corner. film/beams.rs explains the
// method.

// Shift in pixels along x and y of the image, and the energy of each channel, which is -1 where
// the ray does not arrive.
@group(1) @binding(2) var<storage, read_write> corners: array<f32>;

// Points of the source, where there is no closed form.
const SOURCE_POINTS = 64u;

@compute @workgroup_size(64)
fn trace_corners(@builtin(global_invocation_id) id: vec3u) {
    // One row more than there are rows of cells.
    if id.x < frame.per_row && id.y <= frame.per_pass {
        let per_side = vec2f(f32(frame.parts), 0.0);
        let margin = vec2f(-f32(frame.margin), 0.0);
        let position = plane_point(
            sum(quotient(vec2f(f32(id.x), 0.0), per_side), margin),
            sum(quotient(vec2f(f32(frame.first + id.y), 0.0), per_side), margin),
        );
        var photon = trace(position, vec2f(0.0));
        var energy = vec3f(-1.0);
        if !is_stopped(photon) && !is_behind_body(id.y * frame.per_row + id.x) {
            if SOURCE > 0u {
                energy = vec3f(0.0);
                let key = pixel_key(frame.seed, 0u, 0u);
                for (var i = 0u; i < SOURCE_POINTS; i++) {
                    photon.image_point_m = source_point(square(key, i, 0u));
                    energy += technique_energy(photon) * (photon.left / f32(SOURCE_POINTS));
                }
            } else {
                energy = technique_energy(photon) * photon.left;
            }
        }
        var shift = vec2f(photon.shift_m.x, -photon.shift_m.y) * frame.per_pixel_m;
        if FROM_FILM {
            shift = vec2f(0.0);
        }
        if !is_finite(shift.x + shift.y + energy.x + energy.y + energy.z) {
            shift = vec2f(0.0);
            energy = vec3f(-1.0);
        }
        let at = (id.y * frame.per_row + id.x) * (2u + CHANNELS);
        corners[at] = shift.x;
        corners[at + 1u] = shift.y;
        for (var c = 0u; c < CHANNELS; c++) {
            corners[at + 2u + c] = energy[c];
        }
    }
}

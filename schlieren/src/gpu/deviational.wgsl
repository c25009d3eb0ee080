// Integrates deviations from straight rays by position Verlet, or by explicit Euler. This is the
// kernel of march/packet.rs in WGSL, with the same order of operations.
//
// The host adds what march.wgsl names, `const EULER`, `const COMPENSATED`, `const SKIP`, and
// `brick_around` and `count_skipping` (from bricks.wgsl, or without effect).

// Number of steps that are skipped at once where a brick allows it.
const STRETCH = 8u;

// What an element of the way adds to the optical path, by its length: (1+eps)^2 - w_z =
// eps (1 + eps) + u_t^2 / (1 + eps + w_z). All terms are small, and none is a difference.
fn path_rate(eps: f32, v: vec3f, along: vec3f, eps_at_entry: f32) -> f32 {
    let square = dot(v * params.h2, v);
    let u_z = dot(v, along);
    let transverse = square - u_z * u_z;
    return fma(eps, eps, eps) + transverse / (eps + u_z + eps_at_entry + 2.0);
}

fn march_ray(ray: Ray) -> KernelOutput {
    var xi = ray.xi;
    var v = vec3f(0.0);
    var v_rest = vec3f(0.0);
    var opd = 0.0;
    var opd_rest = 0.0;
    var worst_node = 0u;
    if ray.steps == 0u {
        return KernelOutput(v, opd, vec3f(0.0), worst_node);
    }
    // Step numbers are relative to the midpoint of the path, which makes them exact in f32.
    let middle = 0.5 * f32(ray.steps);
    var dt_whole = ray.dt;
    var eps_at_entry = 0.0;
    var skipped = 0u;
    var skipped_rad = 0.0;

    // Two more iterations than steps: one samples the entry, one ends in the exit plane. They are
    // in the same loop so that there is one copy of the sampling code.
    var n = 0u;
    while n < ray.steps + 2u {
        if SKIP && n > 0u && (n - 1u) % STRETCH == 0u && n - 1u + STRETCH <= ray.steps {
            let at = fma(vec3f(f32(n + STRETCH / 2u) - 1.0 - middle), ray.stride, ray.middle) + xi;
            let brick = brick_around(at);
            let length = f32(STRETCH) * dt_whole;
            let lost_rad = fma(brick.x, length, skipped_rad);
            let is_vague = OPD && brick.z * length > params.skip_opd;
            if lost_rad <= params.skip_rad && brick.w == 0.0 && !is_vague {
                skipped_rad = lost_rad;
                skipped += STRETCH;
                n += STRETCH;
                xi = fma(vec3f(length), v, xi);
                if OPD {
                    let more = path_rate(brick.y, v, ray.along, eps_at_entry);
                    let term = fma(length, more, -opd_rest);
                    let sum = rounded(opd + term);
                    opd_rest = rounded(sum - opd) - term;
                    opd = sum;
                }
                continue;
            }
        }
        // Verlet takes samples in the middle of a step, Euler at its start.
        var number = f32(n) - select(0.5, 1.0, EULER) - middle;
        var move_by = dt_whole;
        var dt = dt_whole;
        let entering = n == 0u;
        let leaving = n == ray.steps + 1u;
        if entering {
            number = -middle;
            move_by = 0.0;
            dt = 0.0;
        } else if leaving {
            // tau is not depth: a ray that gained zeta in depth has passed its exit plane by zeta.
            // One step back returns it there. With Verlet, positions still lack the second half of
            // the last step.
            let missing = select(0.5 * dt_whole, 0.0, EULER);
            let u_z = dot(ray.along, v);
            let zeta = fma(missing, u_z, dot(ray.along, xi));
            dt = -zeta / (u_z + eps_at_entry + 1.0);
            number = fma(dt / dt_whole, 0.5, middle);
            move_by = fma(dt, 0.5, missing);
        }
        let moved = fma(vec3f(move_by), v, xi);
        let at = fma(vec3f(number), ray.stride, ray.middle) + select(moved, xi, EULER);
        xi = moved;
        worst_node = max(worst_node, node_kind(at));
        if worst_node > params.survives {
            break;
        }
        let here = sample(at);
        let eps = here.w;

        // v += dt (1 + eps) g / h^2
        let push = fma(dt, eps, dt) * params.rcp_h2;
        let middle_v = select(fma(push * 0.5, here.xyz, v), v, EULER);
        if COMPENSATED {
            let term = fma(push, here.xyz, -v_rest);
            let sum = rounded3(v + term);
            v_rest = rounded3(sum - v) - term;
            v = sum;
        } else {
            v = fma(push, here.xyz, v);
        }
        if OPD {
            // With the mean of v before and after.
            let more = path_rate(eps, middle_v, ray.along, eps_at_entry);
            let term = fma(dt, more, -opd_rest);
            let sum = rounded(opd + term);
            opd_rest = rounded(sum - opd) - term;
            opd = sum;
        }
        if entering {
            eps_at_entry = eps;
            // dt / (1 + eps), with the error of the division only on the small part.
            dt_whole = dt_whole - dt_whole * (eps / (1.0 + eps));
        } else if leaving {
            xi = fma(vec3f(0.5 * dt), v, xi);
        }
        n++;
    }
    if SKIP {
        count_skipping(ray.steps, skipped, skipped_rad);
    }
    return KernelOutput(v, opd, xi, worst_node);
}

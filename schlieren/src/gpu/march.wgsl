// Integrates deviations from straight rays by position Verlet. This is the kernel of
// march/packet.rs in WGSL, with the same order of operations.
//
// The host adds `const OPD`, `node_kind` (from nodes.wgsl, or a constant), `sample` (from
// trilinear.wgsl or bspline.wgsl), and an entry point: rays.wgsl, or those in frame/.

struct Ray {
    // Midpoint of the undisturbed path through the field, in lattice coordinates.
    middle: vec3f,
    // A step of the path parameter.
    dt: f32,
    // A step along the undisturbed ray, in lattice coordinates.
    stride: vec3f,
    // Number of steps; 0 if the ray misses the field.
    steps: u32,
    // Direction times spacing.
    along: vec3f,
    unused_0: u32,
    // Initial deviation: the rounding error of `middle`.
    xi: vec3f,
    unused_1: u32,
}

struct KernelOutput {
    v: vec3f,
    opd: f32,
    xi: vec3f,
    worst_node: u32,
}

struct Params {
    h2: vec3f,
    rays: u32,
    rcp_h2: vec3f,
    // The worst kind of node that a ray can survive.
    survives: u32,
    last: vec3f,
    // `row` and `layer` are the strides of neighbours along y and z.
    row: u32,
    last_cell: vec3f,
    layer: u32,
    dims: vec3u,
    // Layers of cells in a slab of the field; the last may have fewer.
    slab: u32,
    // Always 0, but unknown to the compiler.
    zero: u32,
    unused_0: u32,
    unused_1: u32,
    unused_2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;

struct CellPosition {
    cell: vec3u,
    fraction: vec3f,
}

// The cell of a point, clamped to the first and last cell, and the position in it.
fn locate(at: vec3f) -> CellPosition {
    let inside = min(max(at, vec3f(0.0)), params.last);
    let cell = vec3u(min(inside, params.last_cell));
    return CellPosition(cell, inside - vec3f(cell));
}

// Returns the same number. Vulkan allows compilers to replace (a + b) - a by b, and Mesa's do. No
// compiler can see through this function.
fn rounded(a: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(a) ^ params.zero);
}

fn rounded3(a: vec3f) -> vec3f {
    return bitcast<vec3f>(bitcast<vec3u>(a) ^ vec3u(params.zero));
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

    // Two more iterations than steps: one samples the entry, one ends in the exit plane. They are
    // in the same loop so that there is one copy of the sampling code.
    for (var n = 0u; n < ray.steps + 2u; n++) {
        var number = f32(n) - 0.5 - middle;
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
            // One step back returns it there. Positions still lack the second half of the last
            // step.
            let missing = 0.5 * dt_whole;
            let u_z = dot(ray.along, v);
            let zeta = fma(missing, u_z, dot(ray.along, xi));
            dt = -zeta / (u_z + eps_at_entry + 1.0);
            number = fma(dt / dt_whole, 0.5, middle);
            move_by = fma(dt, 0.5, missing);
        }
        xi = fma(vec3f(move_by), v, xi);
        let at = fma(vec3f(number), ray.stride, ray.middle) + xi;
        worst_node = max(worst_node, node_kind(at));
        if worst_node > params.survives {
            break;
        }
        let here = sample(at);
        let eps = here.w;

        // v += dt (1 + eps) g / h^2
        let push = fma(dt, eps, dt) * params.rcp_h2;
        let middle_v = fma(push * 0.5, here.xyz, v);
        if COMPENSATED {
            let term = fma(push, here.xyz, -v_rest);
            let sum = rounded3(v + term);
            v_rest = rounded3(sum - v) - term;
            v = sum;
        } else {
            v = fma(push, here.xyz, v);
        }
        if OPD {
            // (1+eps)^2 - w_z = eps (1 + eps) + u_t^2 / (1 + eps + w_z), with the mean of v before
            // and after. All terms are small, and none is a difference.
            let square = dot(middle_v * params.h2, middle_v);
            let u_z = dot(middle_v, ray.along);
            let transverse = square - u_z * u_z;
            let more = fma(eps, eps, eps) + transverse / (eps + u_z + eps_at_entry + 2.0);
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
    }
    return KernelOutput(v, opd, xi, worst_node);
}

// Deviations from straight rays by position Verlet, one ray an invocation: the kernel of march/packet.rs in WGSL, with the same order of operations.
//
// In front of this stand `const OPD`, `meet` (nodes.wgsl or nothing) and `sample` (trilinear.wgsl or bspline.wgsl).

struct Ray {
    // Middle of the undisturbed way through the field, in lattice coordinates.
    middle: vec3f,
    // A step of path.
    dt: f32,
    // A step along the undisturbed ray, in lattice coordinates.
    stride: vec3f,
    // 0: the ray misses the field.
    steps: u32,
    // Direction times spacing.
    along: vec3f,
    unused_0: u32,
    // The deviation's start: what rounding left out of `middle`.
    xi: vec3f,
    unused_1: u32,
}

struct KernelOutput {
    v: vec3f,
    opd: f32,
    xi: vec3f,
    met: u32,
}

struct Params {
    h2: vec3f,
    rays: u32,
    rcp_h2: vec3f,
    // The worst kind of node that a ray can survive.
    survives: u32,
    last: vec3f,
    // Distances of neighbours along y and z.
    row: u32,
    last_cell: vec3f,
    layer: u32,
    dims: vec3u,
    // Layers of cells in a slab of the field; the last may have fewer.
    slab: u32,
    // Always 0, which compilers do not know.
    zero: u32,
    unused_0: u32,
    unused_1: u32,
    unused_2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<storage, read_write> outputs: array<KernelOutput>;

struct Place {
    cell: vec3u,
    place: vec3f,
}

// The cell of a point, the lower one at 0 and the last one at n - 1, and the place in it.
fn place_of(at: vec3f) -> Place {
    let inside = min(max(at, vec3f(0.0)), params.last);
    let cell = vec3u(min(inside, params.last_cell));
    return Place(cell, inside - vec3f(cell));
}

// The same number. Vulkan lets compilers take (a + b) - a for b, and Mesa's do; no compiler sees through this.
fn rounded(a: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(a) ^ params.zero);
}

fn rounded3(a: vec3f) -> vec3f {
    return bitcast<vec3f>(bitcast<vec3u>(a) ^ vec3u(params.zero));
}

@compute @workgroup_size(64)
fn march(@builtin(global_invocation_id) id: vec3u) {
    let i = id.x;
    if i >= params.rays {
        return;
    }
    let ray = rays[i];
    var xi = ray.xi;
    var v = vec3f(0.0);
    var v_rest = vec3f(0.0);
    var opd = 0.0;
    var opd_rest = 0.0;
    var met = 0u;
    if ray.steps == 0u {
        outputs[i] = KernelOutput(v, opd, vec3f(0.0), met);
        return;
    }
    // Step numbers are counted from the middle of the way: exact in f32.
    let middle = 0.5 * f32(ray.steps);
    var dt_whole = ray.dt;
    var eps_at_entry = 0.0;

    // Two iterations more than steps, to look at the entry and to end in the exit plane; in the same loop, so that there is one copy of the
    // sampling code.
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
            // tau is not depth: a ray that gained zeta in depth has passed its exit plane by as much. One step back brings it there.
            // Positions still miss the second half of the last step.
            let missing = 0.5 * dt_whole;
            let u_z = dot(ray.along, v);
            let zeta = fma(missing, u_z, dot(ray.along, xi));
            dt = -zeta / (u_z + eps_at_entry + 1.0);
            number = fma(dt / dt_whole, 0.5, middle);
            move_by = fma(dt, 0.5, missing);
        }
        xi = fma(vec3f(move_by), v, xi);
        let at = fma(vec3f(number), ray.stride, ray.middle) + xi;
        met = max(met, meet(at));
        if met > params.survives {
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
            // (1+eps)^2 - w_z = eps (1 + eps) + u_t^2 / (1 + eps + w_z), with the mean of v before and after: all terms small, none a difference.
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
            // dt / (1 + eps), with the division's error on the small part only.
            dt_whole = dt_whole - dt_whole * (eps / (1.0 + eps));
        } else if leaving {
            xi = fma(vec3f(0.5 * dt), v, xi);
        }
    }
    outputs[i] = KernelOutput(v, opd, xi, met);
}

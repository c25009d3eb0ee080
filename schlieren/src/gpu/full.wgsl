// Integrates rays through a strong index, as march/full.rs does in f64, including rays that turn
// and total reflection. Only the numbers are shorter: deviations are small, and their sums are
// compensated.
//
// A ray enters with the rate (1 + eps) times its direction, and deviations are from the ray that
// keeps this rate. march/full.rs has them from the undisturbed ray, whose rate is 1; its steps of
// tau are the same.
//
// The host adds what march.wgsl names, and `advance` (from the file of an integrator).

// What does not change along a ray.
struct Path {
    ray: Ray,
    // Half the steps of the undisturbed ray.
    half: f32,
    eps_at_entry: f32,
}

// A sum and its rounding error (Kahan 1965).
struct Sum3 {
    value: vec3f,
    rest: vec3f,
}

struct Sum {
    value: f32,
    rest: f32,
}

struct State {
    // Deviation of the position in lattice steps, and its rate.
    xi: Sum3,
    v: Sum3,
    // Integral of (1 + eps)^2 - 1 over tau, less eps at the entry times tau.
    excess: Sum,
    // The last sample.
    eps: f32,
}

// sum + a b
fn plus3(sum: Sum3, a: f32, b: vec3f) -> Sum3 {
    let term = fma(vec3f(a), b, -sum.rest);
    let value = rounded3(sum.value + term);
    return Sum3(value, rounded3(value - sum.value) - term);
}

fn plus(sum: Sum, a: f32, b: f32) -> Sum {
    let term = fma(a, b, -sum.rest);
    let value = rounded(sum.value + term);
    return Sum(value, rounded(value - sum.value) - term);
}

// Where the ray is after `whole` steps and a part of one. Whole steps from the middle of the path
// are exact, and the rest is small.
fn position(path: Path, whole: u32, part: f32, xi: vec3f) -> vec3f {
    let number = f32(whole);
    let straight = fma(vec3f(number - path.half), path.ray.stride, path.ray.middle);
    let ahead = fma(number + part, path.eps_at_entry, part);
    return straight + (fma(vec3f(ahead), path.ray.stride, xi) + path.ray.xi);
}

// Rates of v (xyz) and of the excess (w), and eps.
struct Rate {
    v: vec3f,
    excess: f32,
    eps: f32,
}

fn rate_at(path: Path, at: vec3f) -> Rate {
    let here = sample(at);
    let eps = here.w;
    let push = fma(vec3f(eps), here.xyz, here.xyz) * params.rcp_h2;
    return Rate(push, fma(eps, eps, eps) + (eps - path.eps_at_entry), eps);
}

// How far the ray is beyond its exit plane, along the undisturbed ray.
fn beyond_exit(path: Path, whole: u32, part: f32, xi: vec3f) -> f32 {
    let steps = f32(whole) - f32(path.ray.steps) + part;
    let ahead = fma(f32(whole) + part, path.eps_at_entry, steps);
    return fma(path.ray.dt, ahead, dot(path.ray.along, xi));
}

// Zero where the march ends: in the exit plane, or a voxel beyond a face. Rays along a face thus
// stay inside.
fn outside(path: Path, whole: u32, part: f32, xi: vec3f, at: vec3f) -> f32 {
    let beyond = max(-at, at - params.last) - vec3f(1.0);
    let smallest = sqrt(min(params.h2.x, min(params.h2.y, params.h2.z)));
    let beyond_face = max(beyond.x, max(beyond.y, beyond.z)) * smallest;
    return max(beyond_exit(path, whole, part, xi), beyond_face);
}

// A point of the search for the end of the last step: a part of that step, and `outside` there.
struct Bound {
    part: f32,
    outside: f32,
}

// A ray takes as many times the steps of the undisturbed ray at most (`step_limit_factor`).
const STEP_LIMIT_FACTOR = 8u;
// Attempts to end the last step on the exit plane.
const ATTEMPTS = 60u;
const F32_EPSILON = 1.1920929e-7;

fn march_ray(ray: Ray) -> KernelOutput {
    if ray.steps == 0u {
        return KernelOutput(vec3f(0.0), 0.0, vec3f(0.0), 0u);
    }
    var path = Path(ray, 0.5 * f32(ray.steps), 0.0);
    let zero = Sum3(vec3f(0.0), vec3f(0.0));
    // Unlike those of deviational.wgsl, deviations start at zero and not with the rounding error of
    // the middle: the path is a difference of small numbers.
    var before = State(zero, zero, Sum(0.0, 0.0), 0.0);
    var after = before;
    var worst_node = 0u;
    let limit = STEP_LIMIT_FACTOR * ray.steps;
    var whole = 0u;
    // The first step has no length and samples the entry.
    var part = 0.0;
    var outside_before = 0.0;
    // The search for the end: regula falsi, Illinois variant.
    var searching = false;
    var low = Bound(0.0, 0.0);
    var high = low;
    for (var i = 0u; i <= limit + ATTEMPTS; i++) {
        after = advance(path, before, whole, part);
        let at = position(path, whole, part, after.xi.value);
        let out = outside(path, whole, part, after.xi.value, at);
        let entering = i == 0u;
        if entering || out < 0.0 {
            worst_node = max(worst_node, node_kind(at));
        }
        if entering {
            path.eps_at_entry = after.eps;
            outside_before = min(out, 0.0);
            part = 1.0;
            continue;
        }
        if worst_node > params.survives {
            break;
        }
        if !searching {
            if out < 0.0 {
                before = after;
                outside_before = out;
                whole++;
                if whole == limit {
                    worst_node |= TURNED_BIT;
                    break;
                }
                continue;
            }
            searching = true;
            low = Bound(0.0, outside_before);
            high = Bound(1.0, out);
        } else if abs(out) <= F32_EPSILON * ray.dt {
            break;
        } else if out < 0.0 {
            low = Bound(part, out);
            high.outside *= 0.5;
        } else {
            high = Bound(part, out);
            low.outside *= 0.5;
        }
        let next = (low.part * high.outside - high.part * low.outside)
            / (high.outside - low.outside);
        if !(next > low.part && next < high.part) {
            break;
        }
        part = next;
    }
    return arrived(path, after, whole, part, worst_node);
}

// Continues straight to the exit plane, with the rate of the reference medium.
fn arrived(path: Path, end: State, whole: u32, part: f32, worst_node: u32) -> KernelOutput {
    let at = position(path, whole, part, end.xi.value);
    let is_lost = !is_finite(at.x + at.y + at.z);
    if is_lost || worst_node >= TURNED_BIT {
        // Compilers do not know this number, which is not one.
        let none = bitcast<f32>(0x7fc00000u ^ params.zero);
        return KernelOutput(vec3f(0.0), none, path.ray.xi, worst_node | TURNED_BIT);
    }
    let v = end.v.value;
    var xi = end.xi.value;
    var excess = end.excess.value;
    var worst = worst_node;
    var turned = 0.0;
    let missing = -beyond_exit(path, whole, part, xi);
    if worst <= params.survives && missing > F32_EPSILON * path.ray.dt {
        let u_z = path.eps_at_entry + dot(path.ray.along, v);
        if u_z > -1.0 {
            let drift = missing / (1.0 + u_z);
            xi = fma(vec3f(drift), v, xi);
            excess = fma(-drift, path.eps_at_entry, excess);
        } else {
            worst = TURNED_BIT;
            turned = (missing + dot(path.ray.along, xi)) / path.ray.dt;
        }
    }
    let opd = excess - dot(path.ray.along, xi);
    // Where a ray turned is the component along the undisturbed ray, from the exit plane.
    xi = fma(vec3f(-turned), path.ray.stride, xi);
    return KernelOutput(v, opd, xi + path.ray.xi, worst);
}

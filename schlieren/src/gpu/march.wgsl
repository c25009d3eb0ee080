// What all marches of the device share: a ray, its deviation at the exit, and the lattice.
//
// The host adds `const OPD`, `node_kind` (from nodes.wgsl, or a constant), `sample` (from the file
// of an interpolant), `march_ray` (from deviational.wgsl or full.wgsl), and an entry point:
// rays.wgsl, or those in frame/.

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
    // The worst kind of node, and `TURNED_BIT`.
    worst_node: u32,
}

// Of a ray that never reaches its exit plane.
const TURNED_BIT = 4u;

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
    // The largest lost deflection of a ray, and the largest error of the path of a skipped stretch,
    // in units of the march.
    skip_rad: f32,
    skip_opd: f32,
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

// Comparisons with NaN may be left out by compilers.
fn is_finite(a: f32) -> bool {
    return (bitcast<u32>(a) & 0x7f800000u) != 0x7f800000u;
}

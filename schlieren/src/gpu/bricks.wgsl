// Bounds of the bricks of the field (skip.rs), by which rays skip gas that is nearly uniform, and
// counts of what they skipped. Each ray decides by itself. On the CPU the rays of a packet do so
// together, and skip less.

// Of a brick and its neighbours: the largest |grad eps| (x), the centre of the range of eps (y),
// half that range (z), and 1 where not all nodes are gas (w). Gradients are per unit of the march.
@group(0) @binding(BRICKS_BINDING) var<storage, read> bricks: array<vec4f>;
// Steps as a low and a high word, steps that were skipped, and the largest bound on a deflection
// that was lost, as its bits.
@group(0) @binding(SKIPPING_BINDING) var<storage, read_write> skipping: array<atomic<u32>, 5>;

// Lattice steps along the edge of a brick.
const EDGE = 8u;

fn brick_around(at: vec3f) -> vec4f {
    let dims = (params.dims + vec3u(EDGE - 2u)) / EDGE;
    let brick = min(vec3u(max(at, vec3f(0.0))) / EDGE, dims - vec3u(1u));
    return bricks[brick.x + dims.x * (brick.y + dims.y * brick.z)];
}

fn add_count(word: u32, count: u32) {
    let before = atomicAdd(&skipping[word], count);
    if before + count < before {
        atomicAdd(&skipping[word + 1u], 1u);
    }
}

fn count_skipping(steps: u32, skipped: u32, bound_rad: f32) {
    add_count(0u, steps);
    if skipped > 0u {
        add_count(2u, skipped);
        // Bits of positive numbers are in the order of the numbers.
        atomicMax(&skipping[4], bitcast<u32>(bound_rad));
    }
}

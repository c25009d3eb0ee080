// Sorts photons by squares (a counting sort): where each square begins in the order, and then the
// order. Within a square it changes from run to run, which the filter does not notice.

@group(1) @binding(2) var<storage, read_write> row_totals: array<u32>;
@group(1) @binding(3) var<storage, read_write> begins: array<u32>;
@group(1) @binding(4) var<storage, read_write> order: array<u32>;
@group(1) @binding(5) var<storage, read> kept: array<u32>;
// Numbers of photons, and then where the next photon of each square goes.
@group(1) @binding(6) var<storage, read_write> counts: array<atomic<u32>>;

@compute @workgroup_size(64)
fn add_rows(@builtin(global_invocation_id) id: vec3u) {
    let size = squares();
    if id.x < size.y {
        var total = 0u;
        for (var x = 0u; x < size.x; x++) {
            total += atomicLoad(&counts[id.x * size.x + x]);
        }
        row_totals[id.x] = total;
    }
}

@compute @workgroup_size(64)
fn begin_squares(@builtin(global_invocation_id) id: vec3u) {
    let size = squares();
    if id.x < size.y {
        var at = 0u;
        for (var y = 0u; y < id.x; y++) {
            at += row_totals[y];
        }
        for (var x = 0u; x < size.x; x++) {
            let square = id.x * size.x + x;
            let count = atomicExchange(&counts[square], at);
            begins[square] = at;
            at += count;
        }
        if id.x == size.y - 1u {
            begins[size.x * size.y] = at;
        }
    }
}

@compute @workgroup_size(64)
fn order_photons(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let slot = id.x + id.y * groups.x * 64u;
    if slot < arrayLength(&order) {
        let square = kept[slot * KEPT_WORDS];
        if square > 0u {
            order[atomicAdd(&counts[square - 1u], 1u)] = slot;
        }
    }
}

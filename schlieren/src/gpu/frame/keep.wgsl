// Keeps photons for the cone filter, which wants every one of them.

// Of each photon: one more than its square, 0 if it did not land; the position in pixels; and the
// energy of each channel. Floats are kept as their bits.
@group(1) @binding(5) var<storage, read_write> kept: array<u32>;
// Number of photons in each square.
@group(1) @binding(6) var<storage, read_write> counts: array<atomic<u32>>;

fn keep(slot: u32, at: vec2f, energy: vec3f) {
    let square = square_of(at);
    atomicAdd(&counts[square], 1u);
    let to = slot * KEPT_WORDS;
    kept[to] = square + 1u;
    kept[to + 1u] = bitcast<u32>(at.x);
    kept[to + 2u] = bitcast<u32>(at.y);
    for (var c = 0u; c < CHANNELS; c++) {
        kept[to + 3u + c] = bitcast<u32>(energy[c]);
    }
}

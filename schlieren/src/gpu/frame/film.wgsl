// Sums of energy in 64-bit fixed point, as two words with a carry. They do not depend on the order
// of photons, so a frame has the same bits in every run. 2^32 is energy 1, as in film/mod.rs.

// Sums of the films, low word first; counts of photons per pixel; outcomes.
@group(1) @binding(1) var<storage, read_write> film: array<atomic<u32>>;

fn add_word(at: u32, low: u32, high: u32) {
    let before = atomicAdd(&film[at], low);
    let with_carry = high + u32(before + low < low);
    if with_carry > 0u {
        atomicAdd(&film[at + 1u], with_carry);
    }
}

// Adds to a sum. The fraction has 24 bits, so that its product is exact.
fn add_energy(at: u32, energy: f32) {
    let whole = floor(energy);
    add_word(at, u32((energy - whole) * 4294967296.0), u32(whole));
}

// Energy of a photon or of a part of a beam to pixel `pixel` of film `part`.
fn expose(part: u32, pixel: u32, energy: vec3f) {
    let at = (part * frame.width * frame.height + pixel) * CHANNELS * 2u;
    for (var c = 0u; c < CHANNELS; c++) {
        if energy[c] > 0.0 {
            add_energy(at + 2u * c, energy[c]);
        }
    }
}

// Outcomes of a work group, in the order of `Outcomes` of film.rs.
const OUTCOMES = 7u;
const STOPPED = 0u;
const NOT_A_NUMBER = 1u;
const LANDED = 2u;
const ON_FILM = 3u;
const STEPS = 4u;
const BEHIND_BODY = 5u;
const TURNED = 6u;

var<workgroup> outcomes: array<atomic<u32>, 7>;

fn clear_outcomes(lane: u32) {
    if lane < OUTCOMES {
        atomicStore(&outcomes[lane], 0u);
    }
    workgroupBarrier();
}

fn add_outcomes(lane: u32) {
    workgroupBarrier();
    if lane < OUTCOMES {
        let count = atomicLoad(&outcomes[lane]);
        if count > 0u {
            add_word(frame.outcomes + 2u * lane, count, 0u);
        }
    }
}

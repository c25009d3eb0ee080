// Sums of the film, low word first.
@group(1) @binding(1) var<storage, read> film: array<u32>;
@group(1) @binding(2) var<storage, read_write> result: array<f32>;

fn seen(at: u32) -> f32 {
    let sum = f32(film[2u * at + 1u]) + f32(film[2u * at]) * (1.0 / 4294967296.0);
    return sum * frame.per_photon;
}

// Sums of the film, low word first.
@group(1) @binding(1) var<storage, read> film: array<u32>;
@group(1) @binding(2) var<storage, read_write> result: array<f32>;

fn sum_at(at: u32) -> f32 {
    return f32(film[2u * at + 1u]) + f32(film[2u * at]) * (1.0 / 4294967296.0);
}

// Of two films, their sum, or half their difference, which is an estimate of the noise.
fn seen(at: u32) -> f32 {
    if FILMS == 1u {
        return sum_at(at) * frame.per_photon;
    }
    let second = sum_at(at + frame.width * frame.height * CHANNELS);
    if NOISE {
        let each = vec2f(sum_at(at), second) * frame.per_photon_of_film;
        return 0.5 * (each.x - each.y);
    }
    return (sum_at(at) + second) * frame.per_photon;
}

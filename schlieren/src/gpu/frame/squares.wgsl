// Squares of one pixel over the image and a border, by which photons are found. Photons farther out
// are in the squares of the border (filter/cone.rs).

const BORDER = 8u;
// Words of a photon that is kept: its square, its position, its energies.
const KEPT_WORDS = 3u + CHANNELS;

fn squares() -> vec2u {
    return vec2u(frame.width, frame.height) + 2u * BORDER;
}

fn square_of(at: vec2f) -> u32 {
    let last = vec2f(squares() - 1u);
    let place = vec2u(clamp(floor(at) + f32(BORDER), vec2f(0.0), last));
    return place.y * squares().x + place.x;
}

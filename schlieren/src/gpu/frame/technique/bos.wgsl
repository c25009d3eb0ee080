// Random dots seen through the flow (technique/bos.rs). technique[0]: one over the spacing of dots,
// as high and low part; square of a dot's radius in spacings.

// The product of 64-bit numbers, low word first, without what does not fit.
fn multiply_64(a: vec2u, b: vec2u) -> vec2u {
    let a0 = a.x & 0xffffu;
    let a1 = a.x >> 16u;
    let b0 = b.x & 0xffffu;
    let b1 = b.x >> 16u;
    let low = a0 * b0;
    let middle = a1 * b0 + (low >> 16u);
    let more = a0 * b1 + (middle & 0xffffu);
    let high = a1 * b1 + (middle >> 16u) + (more >> 16u);
    return vec2u((more << 16u) | (low & 0xffffu), high + a.x * b.y + a.y * b.x);
}

fn shifted_right(a: vec2u, by: u32) -> vec2u {
    return vec2u((a.x >> by) | (a.y << (32u - by)), a.y >> by);
}

// rt_core::math::mix64.
fn mix_64(z: vec2u) -> vec2u {
    let a = multiply_64(z ^ shifted_right(z, 30u), vec2u(0x1ce4e5b9u, 0xbf58476du));
    let b = multiply_64(a ^ shifted_right(a, 27u), vec2u(0x133111ebu, 0x94d049bbu));
    return b ^ shifted_right(b, 31u);
}

// A signed number in 64 bits.
fn extended(i: i32) -> vec2u {
    return vec2u(u32(i), select(0u, 0xffffffffu, i < 0));
}

// Position of the dot in its cell.
fn dot_offset(cell: vec2i) -> vec2f {
    let x = multiply_64(extended(cell.x), vec2u(0x7f4a7c15u, 0x9e3779b9u));
    let y = multiply_64(extended(cell.y), vec2u(0x27d4eb4fu, 0xc2b2ae3du));
    let bits = mix_64(mix_64(x ^ y.yx ^ vec2u(frame.dots_seed, 0u)));
    return vec2f(bits) / 4294967296.0;
}

fn technique_energy(photon: Photon) -> vec3f {
    let x = product(two_sum(photon.position_m.x, photon.shift_m.x), frame.technique[0].xy);
    let y = product(two_sum(photon.position_m.y, photon.shift_m.y), frame.technique[0].xy);
    let cell = vec2f(whole_to(x), whole_to(y));
    let within = vec2f(sum(x, vec2f(-cell.x, 0.0)).x, sum(y, vec2f(-cell.y, 0.0)).x);
    for (var j = -1; j <= 1; j++) {
        for (var i = -1; i <= 1; i++) {
            let offset = vec2f(vec2i(i, j)) + dot_offset(vec2i(cell) + vec2i(i, j));
            let away = within - offset;
            if dot(away, away) < frame.technique[0].z {
                return vec3f(0.0);
            }
        }
    }
    return vec3f(1.0);
}

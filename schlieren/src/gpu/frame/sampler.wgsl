// Sample points in the unit square: rt_core::sampler in WGSL, with the same bits.
//
// The host adds `const RANDOM`.

fn hash(value: u32) -> u32 {
    var x = value;
    x ^= x >> 16u;
    x *= 0x7feb352du;
    x ^= x >> 15u;
    x *= 0x846ca68bu;
    return x ^ (x >> 16u);
}

fn pixel_key(seed: vec2u, x: u32, y: u32) -> u32 {
    return hash(hash(x ^ seed.x) + y) ^ hash(seed.y ^ 0x5bd1e995u);
}

fn owen_scramble(value: u32, seed: u32) -> u32 {
    var x = reverseBits(value) + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reverseBits(x);
}

fn sobol_second(i: u32) -> u32 {
    var v = i;
    v ^= (v & 0xaaaaaaaau) >> 1u;
    v ^= (v & 0xccccccccu) >> 2u;
    v ^= (v & 0xf0f0f0f0u) >> 4u;
    v ^= (v & 0xff00ff00u) >> 8u;
    v ^= (v & 0xffff0000u) >> 16u;
    return reverseBits(v);
}

// The top 24 bits as a number in 0..1.
fn to_unit(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

// Point `index` of a pixel in dimension `dimension`.
fn square(key: u32, index: u32, dimension: u32) -> vec2f {
    let seed = hash(key + dimension * 0x9e3779b9u);
    if RANDOM {
        let a = hash(seed ^ hash(index));
        return vec2f(to_unit(a), to_unit(hash(a ^ 0x3c6ef372u)));
    }
    let i = owen_scramble(index, seed);
    return vec2f(
        to_unit(owen_scramble(reverseBits(i), hash(seed ^ 0x68bc21ebu))),
        to_unit(owen_scramble(sobol_second(i), hash(seed ^ 0x02e5be93u))),
    );
}

// Sine and cosine of angles within 45 degrees, to 1e-7: WGSL's own may be wrong by 2^-11. Cephes'
// sinf.c, as in rt_core::sampler.
fn sin_cos_to_45_degrees(x: f32) -> vec2f {
    let z = x * x;
    let s = x + x * z * (-0.16666655 + z * (0.008332161 + z * -0.00019515296));
    let c = 1.0 - 0.5 * z + z * z * (0.041666646 + z * (-0.0013887316 + z * 0.000024433157));
    return vec2f(s, c);
}

// The concentric map of Shirley and Chiu (1997).
fn unit_disk(at: vec2f) -> vec2f {
    let p = 2.0 * at - 1.0;
    let near_x = abs(p.x) > abs(p.y);
    let r = select(p.y, p.x, near_x);
    let across = select(p.x, p.y, near_x);
    let ratio = across / select(r, 1.0, r == 0.0);
    let sc = sin_cos_to_45_degrees(0.7853982 * ratio);
    return select(vec2f(r * sc.x, r * sc.y), vec2f(r * sc.y, r * sc.x), near_x);
}

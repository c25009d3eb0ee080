// Bits of the rays that bodies stop, which the CPU has found.
@group(1) @binding(4) var<storage, read> bodies: array<u32>;

fn is_behind_body(ray: u32) -> bool {
    return (bodies[ray / 32u] >> (ray % 32u) & 1u) != 0u;
}

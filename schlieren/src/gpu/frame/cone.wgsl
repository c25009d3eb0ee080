// The cone filter (filter/cone.rs): the energy at a pixel from the photons nearest to its centre,
// with weights that decrease to zero at the farthest of them.

@group(1) @binding(2) var<storage, read_write> result: array<f32>;
@group(1) @binding(3) var<storage, read> begins: array<u32>;
@group(1) @binding(4) var<storage, read> order: array<u32>;
@group(1) @binding(5) var<storage, read> kept: array<u32>;

// Rows and columns of squares, the last ones included.
struct Block {
    low: vec2i,
    high: vec2i,
}

fn block_around(square: vec2i, reach: i32) -> Block {
    let last = vec2i(squares()) - 1;
    return Block(max(square - reach, vec2i(0)), min(square + reach, last));
}

// Photons of a row of a block are neighbours in the order: from x to before y.
fn photons_of_row(block: Block, row: i32) -> vec2u {
    let first = row * i32(squares().x);
    return vec2u(begins[u32(first + block.low.x)], begins[u32(first + block.high.x) + 1u]);
}

fn photons_in(block: Block) -> u32 {
    var count = 0u;
    for (var row = block.low.y; row <= block.high.y; row++) {
        let ends = photons_of_row(block, row);
        count += ends.y - ends.x;
    }
    return count;
}

fn square_of_distance(photon: u32, at: vec2f) -> f32 {
    let words = order[photon] * KEPT_WORDS;
    let d = vec2f(bitcast<f32>(kept[words + 1u]), bitcast<f32>(kept[words + 2u])) - at;
    return d.x * d.x + d.y * d.y;
}

// How many photons of a block are within a distance (x), and the bits of the square of the largest
// of their distances (y).
fn photons_within(block: Block, at: vec2f, square: f32) -> vec2u {
    var count = 0u;
    var largest = 0.0;
    for (var row = block.low.y; row <= block.high.y; row++) {
        let ends = photons_of_row(block, row);
        for (var p = ends.x; p < ends.y; p++) {
            let distance2 = square_of_distance(p, at);
            if distance2 <= square {
                count++;
                largest = max(largest, distance2);
            }
        }
    }
    return vec2u(count, bitcast<u32>(largest));
}

// The block that has the `nearest` photons, a bound on the square of their distances, and how many
// photons are within it.
struct Search {
    block: Block,
    within: f32,
    count: u32,
}

fn search(square: vec2i, at: vec2f, nearest: u32) -> Search {
    let size = vec2i(squares());
    let widest = max(size.x, size.y);
    // The smallest block with enough photons, by doubling and halving.
    var enough = 0;
    while enough < widest && photons_in(block_around(square, enough)) < nearest {
        enough = 2 * enough + 1;
    }
    var too_few = enough / 2 - 1;
    while enough - too_few > 1 {
        let middle = (enough + too_few) / 2;
        if photons_in(block_around(square, middle)) < nearest {
            too_few = middle;
        } else {
            enough = middle;
        }
    }
    // Its corners are as far as the edges of a larger one. Photons from beyond the border can be
    // farther than their square.
    var reach = i32(ceil(1.4142137 * (f32(enough) + 0.5) - 0.5));
    while reach < widest {
        let block = block_around(square, reach);
        let within = (f32(reach) + 0.5) * (f32(reach) + 0.5);
        let found = photons_within(block, at, within);
        if found.x >= nearest {
            return Search(block, bitcast<f32>(found.y), found.x);
        }
        reach += 1 + reach / 2;
    }
    let all = block_around(square, widest);
    let found = photons_within(all, at, 3.0e38);
    return Search(all, bitcast<f32>(found.y), found.x);
}

// Searches by proportion before those by halves of the bits, which end in any case.
const PROPORTIONS = 24u;

// The square of the distance of the `nearest`-th photon: the smallest number within which there are
// as many.
fn square_of_radius(s: Search, at: vec2f, nearest: u32) -> f32 {
    // Positive numbers are in the order of their bits; -1 is below all.
    var low = -1;
    var fewer = 0u;
    var high = bitcast<i32>(s.within);
    var more = s.count;
    for (var i = 0u; more > nearest && high - low > 1; i++) {
        var middle = low + (high - low) / 2;
        if i < PROPORTIONS {
            // Even light has as many photons as area.
            let low_square = bitcast<f32>(max(low, 0));
            var part = f32(nearest - fewer) / f32(more - fewer);
            if (i & 1u) != 0u {
                part = 0.5;
            }
            let by_part = bitcast<i32>(mix(low_square, bitcast<f32>(high), part));
            middle = clamp(by_part, low + 1, high - 1);
        }
        let found = photons_within(s.block, at, bitcast<f32>(middle));
        if found.x < nearest {
            low = middle;
            fewer = found.x;
        } else {
            // Not more than the farthest of those.
            high = min(middle, bitcast<i32>(found.y));
            more = found.x;
        }
    }
    return bitcast<f32>(high);
}

// A sum in 64-bit fixed point, as on the film: it does not depend on the order of photons.
fn add_fixed(sum: vec2u, energy: f32) -> vec2u {
    let whole = floor(energy);
    let low = u32((energy - whole) * 4294967296.0);
    let next = sum.x + low;
    return vec2u(next, sum.y + u32(whole) + u32(next < low));
}

@compute @workgroup_size(64)
fn cone(@builtin(global_invocation_id) id: vec3u) {
    let y = frame.first + id.y;
    if id.x >= frame.width || y >= frame.height {
        return;
    }
    let pixel = (y * frame.width + id.x) * CHANNELS;
    let size = squares();
    let nearest = min(frame.nearest, begins[size.x * size.y]);
    var sums: array<vec2u, CHANNELS>;
    var scale = 0.0;
    if nearest >= 2u {
        let at = vec2f(f32(id.x), f32(y)) + 0.5;
        let s = search(vec2i(vec2u(id.x, y) + BORDER), at, nearest);
        let radius2 = square_of_radius(s, at, nearest);
        if radius2 > 0.0 {
            let radius = sqrt(radius2);
            scale = 0.95492966 * frame.per_photon / radius2;
            for (var row = s.block.low.y; row <= s.block.high.y; row++) {
                let ends = photons_of_row(s.block, row);
                for (var p = ends.x; p < ends.y; p++) {
                    let distance2 = square_of_distance(p, at);
                    if distance2 < radius2 {
                        let weight = max(1.0 - sqrt(distance2) / radius, 0.0);
                        let energies = order[p] * KEPT_WORDS + 3u;
                        for (var c = 0u; c < CHANNELS; c++) {
                            let energy = bitcast<f32>(kept[energies + c]);
                            sums[c] = add_fixed(sums[c], max(weight * energy, 0.0));
                        }
                    }
                }
            }
        }
    }
    for (var c = 0u; c < CHANNELS; c++) {
        let sum = f32(sums[c].y) + f32(sums[c].x) * (1.0 / 4294967296.0);
        result[pixel + c] = sum * scale;
    }
}

// Distributes the energy of a beam's cells: one invocation per cell, which is two triangles. Each
// pixel gets the share of a triangle's area that lies in it (film/beams.rs): by signed areas, or for
// thin and large triangles by cutting them.

@group(1) @binding(2) var<storage, read> corners: array<f32>;

struct Corner {
    // In pixels, relative to a pixel that the cell's corners share.
    at: vec2f,
    energy: vec3f,
    arrives: bool,
}

fn corner(column: u32, row: u32, within: vec2f, base: vec2f) -> Corner {
    let at = (row * frame.per_row + column) * (2u + CHANNELS);
    var out: Corner;
    // The shift minus whole pixels is exact.
    out.at = within + (vec2f(corners[at], corners[at + 1u]) - base);
    for (var c = 0u; c < CHANNELS; c++) {
        out.energy[c] = corners[at + 2u + c];
    }
    out.arrives = out.energy.x >= 0.0;
    return out;
}

// A convex polygon; a triangle clipped by four lines has at most seven corners.
struct Polygon {
    at: array<vec2f, 8>,
    length: u32,
}

// Keeps the part on the side `side` of `limit` across `axis` (Sutherland and Hodgman 1974).
fn clip(polygon: Polygon, axis: u32, limit: f32, side: f32) -> Polygon {
    var whole = polygon;
    var out: Polygon;
    out.length = 0u;
    for (var i = 0u; i < whole.length; i++) {
        let p = whole.at[i];
        let q = whole.at[(i + 1u) % whole.length];
        let dp = side * (p[axis] - limit);
        let dq = side * (q[axis] - limit);
        if dp >= 0.0 && out.length < 8u {
            out.at[out.length] = p;
            out.length++;
        }
        if (dp >= 0.0) != (dq >= 0.0) && out.length < 8u {
            var cut = p + (dp / (dp - dq)) * (q - p);
            cut[axis] = limit;
            out.at[out.length] = cut;
            out.length++;
        }
    }
    return out;
}

// Coordinates are relative to the first corner to avoid cancellation.
fn area(polygon: Polygon) -> f32 {
    var whole = polygon;
    var twice = 0.0;
    for (var i = 2u; i < whole.length; i++) {
        let a = whole.at[i - 1u] - whole.at[0];
        let b = whole.at[i] - whole.at[0];
        twice += a.x * b.y - b.x * a.y;
    }
    return 0.5 * abs(twice);
}

// The part of an edge within a row of pixels: where it enters and leaves the row, and its height
// there, negative where it goes up.
struct EdgePart {
    enters: f32,
    leaves: f32,
    height: f32,
}

// `row` is the upper side of the row of pixels.
fn edge_in_row(p: vec2f, q: vec2f, row: f32) -> EdgePart {
    let top = clamp(p.y, row, row + 1.0);
    let bottom = clamp(q.y, row, row + 1.0);
    let height = bottom - top;
    if height == 0.0 {
        return EdgePart(p.x, p.x, 0.0);
    }
    // The edge's own ends are exact, and nothing is beyond them.
    let slope = (q.x - p.x) / (q.y - p.y);
    let low = min(p.x, q.x);
    let high = max(p.x, q.x);
    let enters = clamp(fma(top - p.y, slope, p.x), low, high);
    let leaves = clamp(fma(bottom - q.y, slope, q.x), low, high);
    return EdgePart(
        select(enters, p.x, top == p.y),
        select(leaves, q.x, bottom == q.y),
        height,
    );
}

// The area of a pixel to the right of a part of an edge, with the sign of its height. `column` is
// the left side of the pixel.
fn area_beside(part: EdgePart, column: f32) -> f32 {
    let low = min(part.enters, part.leaves) - column;
    let high = max(part.enters, part.leaves) - column;
    let width = high - low;
    if width <= 0.0 {
        return part.height * (1.0 - clamp(low, 0.0, 1.0));
    }
    // Of the part: how much is left of the pixel, and how much within it.
    let left = clamp(-low / width, 0.0, 1.0);
    let begin = clamp(low, 0.0, 1.0);
    let end = clamp(high, 0.0, 1.0);
    let within = (end - begin) / width;
    return part.height * (left + within * (1.0 - 0.5 * (begin + end)));
}

// Least area of a triangle for signed areas, and most pixels along its sides: sums of signed areas
// are exact to about 1e-7 of a pixel.
const LEAST_AREA = 0.02;
const MOST_PIXELS = 16;
// A share of this is what rounding leaves beside the triangle.
const NO_SHARE = 4e-6;

// Shares of a triangle in the pixels of a row by signed areas (film/signed_area.rs): an edge that
// goes down takes from the pixels to its right what one that goes up gives them.
struct RowOfEdges {
    ab: EdgePart,
    bc: EdgePart,
    ca: EdgePart,
}

fn row_of_edges(a: vec2f, b: vec2f, c: vec2f, row: f32) -> RowOfEdges {
    return RowOfEdges(edge_in_row(a, b, row), edge_in_row(b, c, row), edge_in_row(c, a, row));
}

fn area_in_pixel(row: RowOfEdges, column: f32) -> f32 {
    return abs(
        (area_beside(row.ab, column) + area_beside(row.bc, column)) + area_beside(row.ca, column)
    );
}

// Returns whether any part falls on the film. `base` is the pixel to which corners are relative.
fn deposit(a: Corner, b: Corner, c: Corner, base: vec2i, area_px: f32) -> bool {
    let energy = (a.energy + b.energy + c.energy) * (area_px / 3.0);
    let size = vec2i(i32(frame.width), i32(frame.height));
    let ab = b.at - a.at;
    let ac = c.at - a.at;
    let whole = 0.5 * abs(ab.x * ac.y - ac.x * ab.y);
    // A triangle in a focus has no area, so all of its energy goes to one pixel.
    if whole < 1e-9 {
        let pixel = base + vec2i(floor((a.at + b.at + c.at) / 3.0));
        if any(pixel < vec2i(0)) || any(pixel >= size) {
            return false;
        }
        expose(0u, u32(pixel.y * size.x + pixel.x), energy);
        return true;
    }
    let first = vec2i(floor(min(a.at, min(b.at, c.at))));
    let last = vec2i(floor(max(a.at, max(b.at, c.at))));
    let low = max(first, -base);
    let high = min(last, size - 1 - base);
    var any_part = false;
    if whole >= LEAST_AREA && all(last - first < vec2i(MOST_PIXELS)) {
        for (var y = low.y; y <= high.y; y++) {
            let row = row_of_edges(a.at, b.at, c.at, f32(y));
            for (var x = low.x; x <= high.x; x++) {
                let share = area_in_pixel(row, f32(x)) / whole;
                if share > NO_SHARE {
                    let pixel = base + vec2i(x, y);
                    expose(0u, u32(pixel.y * size.x + pixel.x), energy * share);
                    any_part = true;
                }
            }
        }
        return any_part;
    }
    var triangle: Polygon;
    triangle.at[0] = a.at;
    triangle.at[1] = b.at;
    triangle.at[2] = c.at;
    triangle.length = 3u;
    for (var y = low.y; y <= high.y; y++) {
        // Relative to the row, and then to the pixel, so that a pixel's share keeps its digits.
        var row = triangle;
        for (var i = 0u; i < 3u; i++) {
            row.at[i].y -= f32(y);
        }
        row = clip(clip(row, 1u, 0.0, 1.0), 1u, 1.0, -1.0);
        for (var x = low.x; x <= high.x; x++) {
            var cell = row;
            for (var i = 0u; i < cell.length; i++) {
                cell.at[i].x -= f32(x);
            }
            cell = clip(clip(cell, 0u, 0.0, 1.0), 0u, 1.0, -1.0);
            let share = area(cell) / whole;
            if share > 0.0 {
                let pixel = base + vec2i(x, y);
                expose(0u, u32(pixel.y * size.x + pixel.x), energy * share);
                any_part = true;
            }
        }
    }
    return any_part;
}

fn distribute(a: Corner, b: Corner, c: Corner, base: vec2i) {
    if !(a.arrives && b.arrives && c.arrives) {
        return;
    }
    atomicAdd(&outcomes[LANDED], 1u);
    let side = 1.0 / f32(frame.parts);
    if deposit(a, b, c, base, 0.5 * side * side) {
        atomicAdd(&outcomes[ON_FILM], 1u);
    }
}

@compute @workgroup_size(64)
fn distribute_cells(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    clear_outcomes(lane);
    if id.x + 1u < frame.per_row && id.y < frame.per_pass {
        let row = frame.first + id.y;
        let cell = vec2u(id.x, row);
        let side = 1.0 / f32(frame.parts);
        let pixel = cell / frame.parts;
        let within = vec2f(cell % frame.parts) * side;
        let at = (id.y * frame.per_row + id.x) * (2u + CHANNELS);
        // Far away, or not a number: such a cell is not on the film.
        let limit = vec2f(1e6);
        let base = clamp(floor(vec2f(corners[at], corners[at + 1u])), -limit, limit);
        let a = corner(id.x, id.y, within, base);
        let b = corner(id.x + 1u, id.y, within + vec2f(side, 0.0), base);
        let d = corner(id.x, id.y + 1u, within + vec2f(0.0, side), base);
        let e = corner(id.x + 1u, id.y + 1u, within + vec2f(side), base);
        let on_film = vec2i(pixel) - i32(frame.margin) + vec2i(base);
        // The diagonal alternates so that no direction is preferred.
        if (row + id.x) % 2u == 0u {
            distribute(a, b, d, on_film);
            distribute(b, e, d, on_film);
        } else {
            distribute(a, b, e, on_film);
            distribute(a, e, d, on_film);
        }
    }
    add_outcomes(lane);
}

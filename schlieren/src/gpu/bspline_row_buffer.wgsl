// Rows of four coefficients along x, so that a row is one read. Coefficients are there four times:
// a GPU takes a quarter as many reads, each with its test of bounds.
@group(0) @binding(BINDING) var<storage, read> rows: array<vec4f>;

fn row_SLAB(o: u32, j: u32, k: u32) -> vec4f {
    return rows[o + j * params.row + k * params.layer];
}


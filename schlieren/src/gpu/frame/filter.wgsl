// Turns the sums of a film into brightness and filters its noise: rows first, then columns, as
// filter/mod.rs does. The host adds `const ROWS`, `FILMS` and `NOISE`, and `seen` and `result` of
// filter_rows.wgsl or filter_columns.wgsl.

// Weights of pixels by distance.
@group(1) @binding(6) var<storage, read> weights: array<f32>;

// At the image's edge, weights outside the image are dropped and the rest are scaled up.
fn filtered(at: u32, place: u32, step: u32, length: u32) -> f32 {
    var value = 0.0;
    var total = 0.0;
    let reach = i32(arrayLength(&weights)) - 1;
    for (var d = -reach; d <= reach; d++) {
        let there = i32(place) + d;
        if there >= 0 && there < i32(length) {
            let weight = weights[abs(d)];
            value += weight * seen(u32(i32(at) + d * i32(step)));
            total += weight;
        }
    }
    return value / total;
}

@compute @workgroup_size(64)
fn filter_noise(@builtin(global_invocation_id) id: vec3u) {
    if id.x < frame.width && id.y < frame.height {
        for (var c = 0u; c < CHANNELS; c++) {
            let at = (id.y * frame.width + id.x) * CHANNELS + c;
            if ROWS {
                result[at] = filtered(at, id.x, CHANNELS, frame.width);
            } else {
                result[at] = filtered(at, id.y, CHANNELS * frame.width, frame.height);
            }
        }
    }
}

// The angle of a point, to 2e-7: WGSL's atan2 may be wrong by 4096 units in the last place. Cephes'
// atanf.c on the octant, as the arctangents of C libraries do.
fn arctangent(y: f32, x: f32) -> f32 {
    let long = max(abs(x), abs(y));
    let short = min(abs(x), abs(y));
    if long == 0.0 {
        return 0.0;
    }
    // Above tan(pi/8) the angle is measured from 45 degrees.
    let is_steep = short > 0.41421356 * long;
    let t = select(short / long, (short - long) / (short + long), is_steep);
    let z = t * t;
    var angle = (((0.080537446 * z - 0.13877685) * z + 0.19977711) * z - 0.3333295) * z * t + t;
    if is_steep {
        angle += 0.78539816;
    }
    if abs(y) > abs(x) {
        angle = 1.5707963 - angle;
    }
    if x < 0.0 {
        angle = 3.1415927 - angle;
    }
    return select(angle, -angle, y < 0.0);
}

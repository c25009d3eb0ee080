// A straight ray through the flow's projection (march/line_of_sight.rs). Light is deflected in the
// plane through the view's centre, and the tilt of its beam causes no shift.

fn map_coordinate(axis: u32, position_m: f32) -> f32 {
    let centre = vec2f(projection.centre[axis], projection.centre_low[axis]);
    let per_m = vec2f(projection.per_m[axis], projection.per_m_low[axis]);
    return sum(centre, times(per_m, position_m)).x;
}

fn cross_flow(position_m: vec2f, tilt: vec2f) -> Crossing {
    var crossing: Crossing;
    let at = vec2f(
        map_coordinate(0u, frame.mirror * position_m.x),
        map_coordinate(1u, position_m.y),
    );
    var meets_field = all(at >= vec2f(0.0)) && all(at <= projection.last);
    crossing.exit_depth_m = projection.exit_depth_m;
    if OBLIQUE {
        let straight = undisturbed(position_m, vec2f(0.0));
        meets_field = straight.ray.steps > 0u;
        crossing.exit_depth_m = straight.exit_depth_m;
    }
    if !meets_field {
        crossing.exit_depth_m = 0.0;
        return crossing;
    }
    let cell = map_cell(at);
    let path = sample_path(cell);
    var slope = path.yz * projection.per_m;
    if OBLIQUE {
        slope = vec2f(sample_right(cell).x, sample_up(cell).x);
    }
    crossing.deflection_rad = vec2f(frame.mirror * slope.x, slope.y);
    crossing.displacement_m = crossing.deflection_rad * crossing.exit_depth_m;
    crossing.path_m = path.x;
    crossing.worst_node = map_node_kind(at);
    return crossing;
}

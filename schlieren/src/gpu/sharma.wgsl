// The Runge-Kutta-Nystroem method by Sharma, Kumar and Ghatak (march/sharma.rs).

fn advance(path: Path, before: State, whole: u32, part: f32) -> State {
    var state = before;
    let dt = part * path.ray.dt;
    let v = before.v.value;
    var rate = Rate(vec3f(0.0), 0.0, 0.0);
    // Sums of rates with the weights of the position, of its rate, and of the excess.
    var of_xi = vec3f(0.0);
    var of_v = vec3f(0.0);
    var of_excess = 0.0;
    // At the start, the middle and the end of the step.
    for (var stage = 0u; stage < 3u; stage++) {
        let along = 0.5 * f32(stage);
        let ahead = along * dt;
        let xi = before.xi.value + fma(vec3f(ahead), v, rate.v * (0.5 * ahead * ahead));
        rate = rate_at(path, position(path, whole, along * part, xi));
        let weight = select(1.0, 4.0, stage == 1u);
        of_xi = fma(vec3f(f32(stage < 2u) * f32(stage + 1u)), rate.v, of_xi);
        of_v = fma(vec3f(weight), rate.v, of_v);
        of_excess = fma(weight, rate.excess, of_excess);
    }
    let sixth = dt * (1.0 / 6.0);
    state.xi = plus3(state.xi, dt, fma(vec3f(sixth), of_xi, v));
    state.v = plus3(state.v, sixth, of_v);
    if OPD {
        state.excess = plus(state.excess, sixth, of_excess);
    }
    state.eps = rate.eps;
    return state;
}

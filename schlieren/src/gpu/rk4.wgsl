// The classical Runge-Kutta method (march/rk4.rs).

fn advance(path: Path, before: State, whole: u32, part: f32) -> State {
    var state = before;
    let dt = part * path.ray.dt;
    let v_before = before.v.value;
    var rate = Rate(vec3f(0.0), 0.0, 0.0);
    // Rate of the position in the stage before.
    var v = v_before;
    // Weighted sums of the rates, of which that of the position is less `v_before`.
    var of_xi = vec3f(0.0);
    var of_v = vec3f(0.0);
    var of_excess = 0.0;
    // At the start, twice in the middle, and at the end of the step.
    for (var stage = 0u; stage < 4u; stage++) {
        let along = 0.5 * f32((stage + 1u) / 2u);
        let ahead = along * dt;
        let xi = fma(vec3f(ahead), v, before.xi.value);
        let pushed = ahead * rate.v;
        v = v_before + pushed;
        rate = rate_at(path, position(path, whole, along * part, xi));
        let weight = select(1.0, 2.0, stage == 1u || stage == 2u);
        of_xi = fma(vec3f(weight), pushed, of_xi);
        of_v = fma(vec3f(weight), rate.v, of_v);
        of_excess = fma(weight, rate.excess, of_excess);
    }
    let sixth = dt * (1.0 / 6.0);
    state.xi = plus3(state.xi, dt, fma(vec3f(1.0 / 6.0), of_xi, v_before));
    state.v = plus3(state.v, sixth, of_v);
    if OPD {
        state.excess = plus(state.excess, sixth, of_excess);
    }
    state.eps = rate.eps;
    return state;
}

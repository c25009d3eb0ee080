// PEFRL (march/pefrl.rs).

const XI = 0.1786178958448091;
const LAMBDA = -0.2123418310626054;
const CHI = -0.0662645826698185;
const OUTER = 0.5 * (1.0 - 2.0 * LAMBDA);
const INNER = 1.0 - 2.0 * (CHI + XI);

fn advance(path: Path, before: State, whole: u32, part: f32) -> State {
    var state = before;
    let dt = part * path.ray.dt;
    var drifted = 0.0;
    // In a loop, so that there is one copy of the sampling code.
    for (var stage = 0u; stage < 4u; stage++) {
        let drift = select(select(CHI, INNER, stage == 2u), XI, stage == 0u);
        let kick = select(LAMBDA, OUTER, stage == 0u || stage == 3u) * dt;
        drifted += drift;
        state.xi = plus3(state.xi, drift * dt, state.v.value);
        let at = position(path, whole, drifted * part, state.xi.value);
        let rate = rate_at(path, at);
        state.v = plus3(state.v, kick, rate.v);
        if OPD {
            state.excess = plus(state.excess, kick, rate.excess);
        }
        state.eps = rate.eps;
    }
    state.xi = plus3(state.xi, XI * dt, state.v.value);
    return state;
}

//! Rays on their way, and exits, in words of 32 bits. All bits arrive.
use rt_core::glam::DVec3;
use schlieren::march::RayState;
use schlieren::path::{Exit, Status};

/// Words of a ray: its number, its samples, and eight doubles.
pub(super) const RAY_WORDS: usize = 18;
/// Words of an exit: the ray's number, five floats, and what happened.
pub(super) const EXIT_WORDS: usize = 7;

pub(super) fn push_ray(words: &mut Vec<u32>, number: u32, state: &RayState) {
    words.extend([number, state.samples]);
    let [xi, u] = [state.xi_m, state.u];
    for v in [state.eps_at_entry, xi.x, xi.y, xi.z, u.x, u.y, u.z, state.path_m] {
        words.extend([v.to_bits() as u32, (v.to_bits() >> 32) as u32]);
    }
}

pub(super) fn read_ray(words: &[u32; RAY_WORDS]) -> (u32, RayState) {
    let double = |k: usize| {
        let [low, high] = [words[2 + 2 * k], words[3 + 2 * k]].map(u64::from);
        f64::from_bits(low | high << 32)
    };
    let state = RayState {
        samples: words[1],
        eps_at_entry: double(0),
        xi_m: DVec3::new(double(1), double(2), double(3)),
        u: DVec3::new(double(4), double(5), double(6)),
        path_m: double(7),
    };
    (words[0], state)
}

pub(super) fn push_exit(words: &mut Vec<u32>, number: u32, exit: &Exit) {
    let [d, m] = [exit.deflection_rad, exit.displacement_m];
    words.push(number);
    words.extend([d[0], d[1], m[0], m[1], exit.opd_m].map(f32::to_bits));
    words.push(match exit.status {
        Status::Free => 0,
        Status::Masked => 1,
        Status::Turned => 2,
        Status::Blocked => 3,
    });
}

/// The ray's number and its exit, without the depth; `None` for what cannot have happened.
pub(super) fn read_exit(words: &[u32; EXIT_WORDS]) -> Option<(u32, Exit)> {
    let [number, dx, dy, mx, my, opd, status] = *words;
    let status = match status {
        0 => Status::Free,
        1 => Status::Masked,
        2 => Status::Turned,
        _ => return None,
    };
    let exit = Exit {
        deflection_rad: [dx, dy].map(f32::from_bits),
        displacement_m: [mx, my].map(f32::from_bits),
        exit_depth_m: 0.0,
        opd_m: f32::from_bits(opd),
        transmission: if status == Status::Masked { 0.0 } else { 1.0 },
        status,
    };
    Some((number, exit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_and_exits_survive_with_all_their_bits() {
        let state = RayState {
            samples: 77,
            eps_at_entry: -1e-5,
            xi_m: DVec3::new(1e-300, -0.0, 3.5),
            u: DVec3::new(f64::MIN_POSITIVE, 2.0 / 3.0, -1e-9),
            path_m: 1.0 / 3.0,
        };
        let mut words = Vec::new();
        push_ray(&mut words, 9, &state);
        let (number, read) = read_ray(&words[..].try_into().expect("the words of a ray"));
        let bits = |s: &RayState| {
            [s.xi_m.to_array(), s.u.to_array(), [s.eps_at_entry, s.path_m, 0.0]]
                .map(|v| v.map(f64::to_bits))
        };
        assert_eq!((number, read.samples, bits(&read)), (9, 77, bits(&state)));

        for status in [Status::Free, Status::Masked, Status::Turned] {
            let transmission = if status == Status::Masked { 0.0 } else { 1.0 };
            let exit = Exit {
                deflection_rad: [1e-9, -0.0],
                displacement_m: [3e-20, 7.0],
                opd_m: -1e-12,
                transmission,
                status,
                ..Exit::UNDISTURBED
            };
            let mut words = Vec::new();
            push_exit(&mut words, 5, &exit);
            let words: [u32; EXIT_WORDS] = words[..].try_into().expect("the words of an exit");
            assert_eq!(read_exit(&words), Some((5, exit)));
            assert_eq!(read_exit(&[words[0], 0, 0, 0, 0, 0, 9]), None);
        }
    }
}

//! Which arrays are the velocity of a flow: a vector, or a number for each of its components.
//!
//! Files with numbers only, as CGNS and tables, have the components as arrays: `VelocityX`
//! (CGNS), `x-velocity` (Fluent), `Velocity u` (CFD-Post), `Velocity[i]` (Star-CCM+), `Velocity:0`
//! and `U_0` (exports of ParaView), `Momentum_x` (SU2), `u`, `v`, `w`.

use crate::model::DataArray;
use glam::DVec3;

/// Names of velocities and momenta, in lower case.
const VECTORS: [&str; 8] = ["u", "v", "vel", "velocity", "momentum", "rhou", "umean", "velocities"];

/// Names before or after which a label says the component.
const BASES: [&str; 5] = ["velocity", "velocities", "vel", "momentum", "umean"];

/// Labels of the components after a base, and before it.
const AFTER: [[&str; 3]; 4] = [["x", "y", "z"], ["u", "v", "w"], ["i", "j", "k"], ["0", "1", "2"]];
const BEFORE: [[&str; 3]; 3] = [["x", "y", "z"], ["u", "v", "w"], ["axial", "radial", "swirl"]];

/// Names of components that say by themselves what they are.
const WHOLE: [[&str; 3]; 1] = [["rhou", "rhov", "rhow"]];

/// Short names, which may be something else as well: derivatives of `u` are called `u_x`, too.
const SHORT: [[&str; 3]; 5] = [
    ["u", "v", "w"],
    ["ux", "uy", "uz"],
    ["vx", "vy", "vz"],
    ["u0", "u1", "u2"],
    ["v0", "v1", "v2"],
];

/// The arrays with the velocity.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct VelocityArrays {
    /// Their names, for messages.
    pub(super) name: String,
    /// The array and its component along each axis; `None` across a plane.
    along: [Option<(String, usize)>; 3],
}

impl VelocityArrays {
    /// The velocity among these arrays: the first vector with such a name, or else the first
    /// components with such names. Short names count where there is one set of them. `across` is
    /// the axis across a plane, along which there need be no component.
    pub(super) fn among(arrays: &[DataArray], across: Option<usize>) -> Option<VelocityArrays> {
        if let Some(a) = arrays.iter().find(|a| is_vector(a)) {
            let along = [0, 1, 2].map(|c| (c < a.components).then(|| (a.name.clone(), c)));
            return Some(VelocityArrays { name: a.name.clone(), along });
        }
        let mut sets: Vec<Components<'_>> = Vec::new();
        for a in arrays.iter().filter(|a| a.components == 1) {
            let Some((family, axis)) = component(&a.name) else { continue };
            let at = sets.iter().position(|s| s.family == family).unwrap_or_else(|| {
                sets.push(Components { family, along: Default::default() });
                sets.len() - 1
            });
            sets[at].along[axis].push(&a.name);
        }
        sets.retain(|s| s.is_complete(across));
        let mut short = sets.iter().filter(|s| s.family.is_short);
        let found = match (sets.iter().find(|s| !s.family.is_short), short.next(), short.next()) {
            (Some(long), ..) => long,
            (None, Some(only), None) => only,
            _ => return None,
        };
        let along = [0, 1, 2].map(|a| found.along[a].first().map(|name| (name.to_string(), 0)));
        let names: Vec<&str> = along.iter().flatten().map(|a| a.0.as_str()).collect();
        Some(VelocityArrays { name: names.join(", "), along })
    }

    /// The component along an axis of tuple `i`, where `array` finds an array by its name: 0 across
    /// a plane, NaN where there is no such array.
    pub(super) fn component<'a>(
        &self,
        axis: usize,
        array: impl Fn(&str) -> Option<&'a DataArray>,
        i: usize,
    ) -> f64 {
        let Some((name, c)) = &self.along[axis] else { return 0.0 };
        array(name).filter(|a| *c < a.components).map_or(f64::NAN, |a| a.get(i, *c))
    }

    /// As [`Self::component`], the length of the vector.
    pub(super) fn speed<'a>(&self, array: impl Fn(&str) -> Option<&'a DataArray>, i: usize) -> f64 {
        DVec3::from([0, 1, 2].map(|axis| self.component(axis, &array, i))).length()
    }
}

/// What the names of the components of one vector have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Family {
    base: &'static str,
    /// The labels, by the first.
    labels: &'static str,
    is_before: bool,
    is_mean: bool,
    is_short: bool,
}

/// The names of components along each axis.
struct Components<'a> {
    family: Family,
    along: [Vec<&'a str>; 3],
}

impl Components<'_> {
    /// One along each axis, where `across` may have none.
    fn is_complete(&self, across: Option<usize>) -> bool {
        let fits = |a: usize| match self.along[a].len() {
            1 => true,
            n => n == 0 && across == Some(a),
        };
        (0..3).all(fits)
    }
}

/// Of which vector a name is a component, and along which axis.
fn component(name: &str) -> Option<(Family, usize)> {
    let plain = plain(name);
    let without = plain.strip_prefix("mean").or_else(|| plain.strip_suffix("mean"));
    let without = without.filter(|p| *p != "u");
    let (plain, is_mean) = (without.unwrap_or(&plain), without.is_some());
    let find = |labels: &'static [[&'static str; 3]], label: &str| {
        labels.iter().find_map(|l| Some((l[0], l.iter().position(|x| *x == label)?)))
    };
    for base in BASES {
        for is_before in [false, true] {
            let (label, labels): (_, &[_]) = match is_before {
                false => (plain.strip_prefix(base), &AFTER),
                true => (plain.strip_suffix(base), &BEFORE),
            };
            if let Some((labels, axis)) = label.and_then(|l| find(labels, l)) {
                return Some((Family { base, labels, is_before, is_mean, is_short: false }, axis));
            }
        }
    }
    let whole: [(&'static [[&'static str; 3]], bool); 2] = [(&WHOLE, false), (&SHORT, true)];
    whole.into_iter().find_map(|(names, is_short)| {
        let (labels, axis) = find(names, plain)?;
        Some((Family { base: "", labels, is_before: false, is_mean, is_short }, axis))
    })
}

/// A name in lower case without its unit and what separates its parts: `velocityi` for
/// `Velocity[i] (m/s)`.
fn plain(name: &str) -> String {
    let name = name.to_lowercase();
    let (head, rest) = name.split_at(name.find(['[', '(']).unwrap_or(name.len()));
    let inner = rest.get(1..).unwrap_or("").split([']', ')']).next().unwrap_or("").trim();
    let is_label = AFTER.iter().flatten().any(|l| *l == inner);
    let mut plain: String = head.chars().filter(|c| !"-_ :.".contains(*c)).collect();
    plain.push_str(if is_label { inner } else { "" });
    plain
}

/// Whether an array is a velocity, by its name and the number of its components.
fn is_vector(a: &DataArray) -> bool {
    let name = a.name.to_lowercase();
    let end = name.find(['[', '(', ' ']).unwrap_or(name.len());
    (2..=3).contains(&a.components) && VECTORS.contains(&name[..end].trim())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Values;

    /// The velocity found among numbers with these names.
    fn found(names: &[&str], across: Option<usize>) -> Option<String> {
        let arrays: Vec<DataArray> =
            names.iter().map(|n| DataArray::new(*n, 1, Values::F64(vec![1.0]))).collect();
        VelocityArrays::among(&arrays, across).map(|v| v.name)
    }

    #[test]
    fn components_of_programs_are_one_vector() {
        for names in [
            ["VelocityX", "VelocityY", "VelocityZ"],
            ["x-velocity", "y-velocity", "z-velocity"],
            ["mean-x-velocity", "mean-y-velocity", "mean-z-velocity"],
            ["X Velocity (m/s)", "Y Velocity (m/s)", "Z Velocity (m/s)"],
            ["Velocity u [ m s^-1 ]", "Velocity v [ m s^-1 ]", "Velocity w [ m s^-1 ]"],
            ["Velocity[i] (m/s)", "Velocity[j] (m/s)", "Velocity[k] (m/s)"],
            ["Velocity:0", "Velocity:1", "Velocity:2"],
            ["U_0", "U_1", "U_2"],
            ["UMean_0", "UMean_1", "UMean_2"],
            ["Momentum_x", "Momentum_y", "Momentum_z"],
            ["u", "v", "w"],
            ["U [m/s]", "V [m/s]", "W [m/s]"],
            ["velx", "vely", "velz"],
            ["rhou", "rhov", "rhow"],
        ] {
            let all = Some(names.join(", "));
            let [x, y, z] = names;
            assert_eq!(found(&["T", z, x, "p", y], None), all);
            // In a plane, two are enough, if they are those along it.
            assert_eq!(found(&[x, y], Some(2)), Some([x, y].join(", ")));
            assert_eq!(found(&[x, z], Some(1)), Some([x, z].join(", ")));
            for (some, across) in [(&[x, y][..], None), (&[x, y], Some(1)), (&[x], Some(2))] {
                assert_eq!(found(some, across), None, "{some:?} {across:?}");
            }
        }
        let axial = ["axial-velocity", "radial-velocity"];
        assert_eq!(found(&axial, Some(2)), Some(axial.join(", ")));
    }

    #[test]
    fn ambiguous_sets_and_other_numbers_are_none() {
        for names in [
            // Derivatives, or a second velocity.
            &["u_x", "u_y", "u_z", "v_x", "v_y", "v_z"][..],
            &["u", "v", "w", "u_x", "u_y", "u_z"],
            // Twice the same.
            &["velocity_x", "VelocityX", "VelocityY", "VelocityZ"],
            // Components of two vectors.
            &["x-velocity", "mean-y-velocity", "z-velocity"],
            &["velocity-magnitude", "dx-velocity-dx", "dx-velocity-dy", "dx-velocity-dz"],
            &["u", "v", "omega"],
        ] {
            assert_eq!(found(names, None), None, "{names:?}");
        }
        // A long name says what it is, whatever the short ones are.
        let long = ["u_x", "u_y", "u_z", "v_x", "v_y", "v_z", "vel_x", "vel_y", "vel_z"];
        assert_eq!(found(&long, None), Some("vel_x, vel_y, vel_z".into()));
        // A vector goes before numbers.
        let of =
            |name: &str, components, n| DataArray::new(name, components, Values::F64(vec![2.0; n]));
        let arrays = [of("u", 1, 1), of("v", 1, 1), of("w", 1, 1), of("U", 3, 3)];
        let found = VelocityArrays::among(&arrays, None).unwrap();
        assert_eq!(found.name, "U");
        let array = |name: &str| arrays.iter().find(|a| a.name == name);
        assert_eq!(found.speed(array, 0), 12f64.sqrt());
    }
}

//! Sets of the ten properties of both sides' materials: those that a program has set, and those
//! that the driver must be told.
//!
//! Mesa defers what `glMaterial` sets until it needs it, at a draw or a query. Then it overwrites
//! whatever colour material made of the colour meanwhile. So a program that sets a material at the
//! end of a frame, and enables colour material at the beginning of the next (OpenSceneGraph), is
//! drawn with the material. A query or draw in between changes that, and so does setting more than
//! the program has set.

use super::material::{Materials, sides};
use crate::driver::gl;
use crate::enums::*;

/// The properties in the order of the bits. Those of the back follow those of the front.
const NAMES: [u32; 5] = [AMBIENT, DIFFUSE, SPECULAR, EMISSION, SHININESS];

/// A set of properties.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct MaterialProperties(u16);

impl MaterialProperties {
    pub(crate) const ALL: MaterialProperties = MaterialProperties(0x3ff);

    /// The properties that a call of `glMaterial` sets.
    pub(crate) fn of(face: u32, what: u32) -> MaterialProperties {
        let one = |name: u32| NAMES.iter().position(|n| *n == name).map_or(0, |i| 1_u16 << i);
        let bits = match what {
            AMBIENT_AND_DIFFUSE => one(AMBIENT) | one(DIFFUSE),
            _ => one(what),
        };
        MaterialProperties(sides(face).iter().fold(0, |all, side| all | bits << (5 * side)))
    }

    /// The properties that differ.
    pub(crate) fn changed(a: &Materials, b: &Materials) -> MaterialProperties {
        let differs = |i: &usize| value(a, *i) != value(b, *i);
        MaterialProperties((0..10).filter(differs).fold(0, |bits, i| bits | 1 << i))
    }

    pub(crate) fn add(&mut self, other: MaterialProperties) {
        self.0 |= other.0;
    }

    pub(crate) fn is_empty(self) -> bool {
        self.0 == 0
    }

    fn each(self) -> impl Iterator<Item = usize> {
        (0..10).filter(move |i| self.0 >> i & 1 == 1)
    }

    /// Sends these properties of `materials` to the driver.
    pub(crate) fn send(self, materials: &Materials) {
        for i in self.each() {
            let (face, name) = place(i);
            gl::materialfv(face, name, &value(materials, i));
        }
    }

    /// Sets the driver's values again, so that it defers them as it did before we drew.
    pub(crate) fn set_again(self) {
        let values: Vec<_> = self.each().map(|i| (i, place(i))).collect();
        let asked = values.into_iter().map(|(i, (face, name))| match i % 5 {
            4 => (face, name, [gl::material::<1>(face, name)[0], 0.0, 0.0, 0.0]),
            _ => (face, name, gl::material::<4>(face, name)),
        });
        // All queries first, because each makes the driver apply what it has deferred.
        let asked: Vec<_> = asked.collect();
        for (face, name, v) in asked {
            gl::materialfv(face, name, &v);
        }
    }
}

fn place(i: usize) -> (u32, u32) {
    (if i < 5 { FRONT } else { BACK }, NAMES[i % 5])
}

fn value(materials: &Materials, i: usize) -> [f32; 4] {
    let m = &materials[i / 5];
    match i % 5 {
        0 => m.ambient,
        1 => m.diffuse,
        2 => m.specular,
        3 => m.emission,
        _ => [m.shininess, 0.0, 0.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::super::material::set_material;
    use super::*;

    #[test]
    fn calls_name_the_properties_that_they_change() {
        let calls = [
            (FRONT, AMBIENT),
            (BACK, DIFFUSE),
            (FRONT_AND_BACK, SPECULAR),
            (BACK, AMBIENT_AND_DIFFUSE),
            (FRONT, EMISSION),
            (FRONT_AND_BACK, SHININESS),
        ];
        for (face, what) in calls {
            let (before, mut after) = (Materials::default(), Materials::default());
            assert!(set_material(&mut after, face, what, [1.0, 2.0, 3.0, 4.0]));
            let of = MaterialProperties::of(face, what);
            assert_eq!(MaterialProperties::changed(&before, &after), of, "{face:x} {what:x}");
            assert!(!of.is_empty());
        }
        assert!(
            MaterialProperties::of(7, AMBIENT).is_empty()
                && MaterialProperties::of(FRONT, 7).is_empty()
        );
        let mut all = MaterialProperties::default();
        NAMES.iter().for_each(|n| all.add(MaterialProperties::of(FRONT_AND_BACK, *n)));
        assert_eq!(all, MaterialProperties::ALL);
    }
}

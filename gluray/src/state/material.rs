//! Materials of the fixed-function lighting, front and back.

use crate::enums::*;

/// The material of one side.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Material {
    pub(crate) ambient: [f32; 4],
    pub(crate) diffuse: [f32; 4],
    pub(crate) specular: [f32; 4],
    pub(crate) emission: [f32; 4],
    pub(crate) shininess: f32,
}

/// The materials of front and back.
pub(crate) type Materials = [Material; 2];

/// The sides that a face argument names.
pub(crate) fn sides(face: u32) -> &'static [usize] {
    match face {
        FRONT => &[0],
        BACK => &[1],
        FRONT_AND_BACK => &[0, 1],
        _ => &[],
    }
}

/// Sets a parameter of `glMaterial`. False when OpenGL would refuse it.
pub(crate) fn set_material(materials: &mut Materials, face: u32, what: u32, v: [f32; 4]) -> bool {
    let ok = !sides(face).is_empty() && (what != SHININESS || (0.0..=128.0).contains(&v[0]));
    if !ok {
        return false;
    }
    for &side in sides(face) {
        let m = &mut materials[side];
        match what {
            AMBIENT => m.ambient = v,
            DIFFUSE => m.diffuse = v,
            SPECULAR => m.specular = v,
            EMISSION => m.emission = v,
            SHININESS => m.shininess = v[0],
            AMBIENT_AND_DIFFUSE => (m.ambient, m.diffuse) = (v, v),
            _ => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_refuse_what_opengl_refuses() {
        let mut m = Materials::default();
        assert!(set_material(&mut m, FRONT, DIFFUSE, [0.5, 0.25, 1.0, 1.0]));
        assert_eq!((m[0].diffuse[1], m[1].diffuse[1]), (0.25, 0.0));
        assert!(!set_material(&mut m, FRONT, SHININESS, [129.0, 0.0, 0.0, 0.0]));
        assert!(!set_material(&mut m, 7, DIFFUSE, [0.0; 4]));
        assert!(set_material(&mut m, FRONT_AND_BACK, AMBIENT_AND_DIFFUSE, [1.0; 4]));
        assert_eq!((m[1].ambient, m[1].diffuse), ([1.0; 4], [1.0; 4]));
    }
}

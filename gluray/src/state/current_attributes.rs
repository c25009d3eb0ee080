//! Current normal, colour, texture coordinate and material: what a vertex takes with it.

use super::material_properties::MaterialProperties;
use crate::interpose::driver::gl;
use crate::state::enums::*;

/// One side's material.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Material {
    pub(crate) ambient: [f32; 4],
    pub(crate) diffuse: [f32; 4],
    pub(crate) specular: [f32; 4],
    pub(crate) emission: [f32; 4],
    pub(crate) shininess: f32,
}

/// Front and back.
pub(crate) type Materials = [Material; 2];

/// Which of front and back a face argument names.
pub(crate) fn sides(face: u32) -> &'static [usize] {
    match face {
        FRONT => &[0],
        BACK => &[1],
        FRONT_AND_BACK => &[0, 1],
        _ => &[],
    }
}

/// Sets a parameter of `glMaterial`; false when OpenGL would refuse it.
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

/// What the next vertex takes with it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct CurrentAttributes {
    pub(crate) normal: [f32; 3],
    pub(crate) color: [f32; 4],
    pub(crate) tex: [f32; 4],
    pub(crate) materials: Materials,
}

/// Bits of what the driver has not been told yet.
pub(crate) mod stale {
    pub(crate) const NORMAL: u8 = 1;
    pub(crate) const COLOR: u8 = 2;
    pub(crate) const TEX: u8 = 4;
    pub(crate) const MATERIAL: u8 = 8;
}

/// The current attributes, and which of them the driver has not been told yet.
#[derive(Default)]
pub(crate) struct AttributeState {
    pub(crate) current: CurrentAttributes,
    /// A colour that colour material did not take over (see
    /// [`CurrentAttributes::untracked_color`]).
    pub(crate) untracked_color: Option<[f32; 4]>,
    /// The attributes that the driver does not know yet: bits of [`stale`].
    pub(crate) stale: u8,
    /// The properties of materials that the driver does not know yet.
    pub(crate) stale_properties: MaterialProperties,
    /// The properties that `glMaterial` has set since the last draw.
    pub(crate) set_since_draw: MaterialProperties,
}

impl CurrentAttributes {
    /// The driver's values.
    pub(crate) fn query() -> CurrentAttributes {
        let mut materials = Materials::default();
        for (m, face) in materials.iter_mut().zip([FRONT, BACK]) {
            m.ambient = gl::material(face, AMBIENT);
            m.diffuse = gl::material(face, DIFFUSE);
            m.specular = gl::material(face, SPECULAR);
            m.emission = gl::material(face, EMISSION);
            m.shininess = gl::material::<1>(face, SHININESS)[0];
        }
        CurrentAttributes {
            normal: gl::floats(CURRENT_NORMAL),
            color: gl::floats(CURRENT_COLOR),
            tex: gl::floats(CURRENT_TEXTURE_COORDS),
            materials,
        }
    }

    /// The colour, where the driver's material is not what colour material makes of it. Mesa
    /// compares colours: set the same colour again after `glMaterial`, and the material stays,
    /// which then lights what has no colours of its own.
    pub(crate) fn untracked_color(&self, color_material: Option<(u32, u32)>) -> Option<[f32; 4]> {
        let (face, what) = color_material?;
        let mut followed = self.materials;
        set_material(&mut followed, face, what, self.color);
        (followed != self.materials).then_some(self.color)
    }

    /// Tells the driver what `bits` name; of materials, these properties.
    pub(crate) fn send(&self, bits: u8, of_materials: MaterialProperties) {
        let [r, g, b, a] = self.color;
        if bits & stale::MATERIAL != 0 {
            of_materials.send(&self.materials);
        }
        // After the materials: with colour material the colour is one of them.
        if bits & stale::COLOR != 0 {
            gl::color4f(r, g, b, a);
        }
        if bits & stale::NORMAL != 0 {
            gl::normal3f(self.normal[0], self.normal[1], self.normal[2]);
        }
        if bits & stale::TEX != 0 {
            gl::tex_coord4f(self.tex[0], self.tex[1], self.tex[2], self.tex[3]);
        }
    }

    /// Tells the driver, which knows `before`, what is new.
    pub(crate) fn send_changes(&self, before: &CurrentAttributes) {
        let bit = |changed: bool, bits: u8| if changed { bits } else { 0 };
        // Materials may replace what colour material made of the colour.
        let bits = bit(self.materials != before.materials, stale::MATERIAL | stale::COLOR)
            | bit(self.color != before.color, stale::COLOR)
            | bit(self.normal != before.normal, stale::NORMAL)
            | bit(self.tex != before.tex, stale::TEX);
        self.send(bits, MaterialProperties::changed(&self.materials, &before.materials));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_material_that_is_not_its_colour_is_found() {
        let mut now = CurrentAttributes { color: [0.8; 4], ..CurrentAttributes::default() };
        set_material(&mut now.materials, FRONT_AND_BACK, AMBIENT_AND_DIFFUSE, [0.8; 4]);
        let follows = Some((FRONT_AND_BACK, AMBIENT_AND_DIFFUSE));
        assert_eq!(now.untracked_color(follows), None);
        set_material(&mut now.materials, FRONT_AND_BACK, AMBIENT, [0.2; 4]);
        assert_eq!(now.untracked_color(follows), Some([0.8; 4]));
        assert_eq!(now.untracked_color(Some((FRONT, DIFFUSE))), None);
        assert_eq!(now.untracked_color(None), None);
    }

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

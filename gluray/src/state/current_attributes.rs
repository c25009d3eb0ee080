//! The current normal, colour, texture coordinate and material, which a vertex takes.

use super::material::{Materials, set_material};
use super::material_properties::MaterialProperties;
use crate::driver::gl;
use crate::enums::*;
use crate::state::snapshot::Snapshot;
use crate::watched_calls;

/// The values that the next vertex takes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct CurrentAttributes {
    pub(crate) normal: [f32; 3],
    pub(crate) color: [f32; 4],
    pub(crate) tex: [f32; 4],
    pub(crate) materials: Materials,
}

/// Bits of the attributes that the driver has not been told yet.
pub(crate) mod stale {
    pub(crate) const NORMAL: u8 = 1;
    pub(crate) const COLOR: u8 = 2;
    pub(crate) const TEX: u8 = 4;
    pub(crate) const MATERIAL: u8 = 8;
    pub(crate) const ALL: u8 = NORMAL | COLOR | TEX | MATERIAL;
}

/// The current attributes, and those that the driver has not been told yet.
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

impl AttributeState {
    /// Remembers that the driver does not know an attribute.
    #[inline(always)]
    pub(crate) fn mark_stale(&mut self, bit: u8) {
        if self.stale == 0 {
            watched_calls::arm();
        }
        self.stale |= bit;
    }

    /// Tells the driver the current attributes that it does not know.
    pub(crate) fn sync(&mut self) {
        if self.stale != 0 {
            let bits = std::mem::take(&mut self.stale);
            self.current.send(bits, std::mem::take(&mut self.stale_properties));
        }
    }

    /// The context is current again: nothing is held back from the driver.
    pub(crate) fn on_made_current(&mut self) {
        self.stale = 0;
        (self.stale_properties, self.set_since_draw) =
            (MaterialProperties::default(), MaterialProperties::default());
    }

    /// True when a vertex now would have alpha 1 in state `s`.
    #[inline]
    pub(crate) fn is_opaque(&self, s: &Snapshot) -> bool {
        self.is_opaque_with(s, self.current.color)
    }

    /// The same with another colour than the current one.
    #[inline]
    pub(crate) fn is_opaque_with(&self, s: &Snapshot, color: [f32; 4]) -> bool {
        let tracked =
            s.color_material.is_some_and(|(_, what)| matches!(what, DIFFUSE | AMBIENT_AND_DIFFUSE));
        match s.lighting {
            true if !tracked => self.current.materials.iter().all(|m| m.diffuse[3] == 1.0),
            _ => color[3] == 1.0,
        }
    }

    /// Sends Begin and recorded vertices to the driver, which knows all current attributes then.
    pub(crate) fn replay(&mut self, mode: u32, vertices: Vec<([f32; 3], CurrentAttributes)>) {
        if let Some((_, first)) = vertices.first() {
            first.send(stale::ALL, MaterialProperties::ALL);
        }
        gl::begin(mode);
        let mut before: Option<CurrentAttributes> = None;
        for (p, c) in vertices {
            let changed = before.is_none_or(|b| b.materials != c.materials);
            let bits = stale::NORMAL | stale::COLOR | stale::TEX;
            c.send(bits | if changed { stale::MATERIAL } else { 0 }, MaterialProperties::ALL);
            gl::vertex4f(p[0], p[1], p[2], 1.0);
            before = Some(c);
        }
        self.current.send(stale::ALL, MaterialProperties::ALL);
        (self.stale, self.stale_properties) = (0, MaterialProperties::default());
    }
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

    /// The colour, if the driver's material is not what colour material makes of it. Mesa compares
    /// colours: when the same colour is set again after `glMaterial`, it keeps the material, which
    /// then lights draws without colours of their own.
    pub(crate) fn untracked_color(&self, color_material: Option<(u32, u32)>) -> Option<[f32; 4]> {
        let (face, what) = color_material?;
        let mut followed = self.materials;
        set_material(&mut followed, face, what, self.color);
        (followed != self.materials).then_some(self.color)
    }

    /// Sends the attributes in `bits` to the driver; of materials, these properties.
    pub(crate) fn send(&self, bits: u8, of_materials: MaterialProperties) {
        let [r, g, b, a] = self.color;
        if bits & stale::MATERIAL != 0 {
            of_materials.send(&self.materials);
        }
        // After the materials, because colour material makes the colour one of them.
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

    /// Sends what has changed since `before` to the driver.
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
}

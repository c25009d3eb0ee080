//! Applies the user's changes to materials and lights. A draw is changed before it is traced. The
//! driver never sees the changes.
//!
//! Mode `match` shows the driver's image, so nothing is changed there.

use crate::capture::draw::{Attributes, Draw, Shading, Values};
use crate::classify::vtk::{ProgramLight, VtkProgram};
use crate::host::config::{Lights, Material, Mode, Settings, Surface};
use crate::host::panel_client::key_of;
use crate::state::snapshot::{GlLight, Snapshot};
use crate::trace::occlusion::MOST_LIGHTS;
use std::sync::Arc;

/// The user's material properties that OpenGL's lighting does not have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RayMaterial {
    pub(crate) surface: Surface,
    /// A factor on the program's own opacity.
    pub(crate) opacity: f32,
    /// The share of mirror reflection that is added.
    pub(crate) mirror: f32,
    pub(crate) roughness: f32,
    pub(crate) ior: f32,
    /// The colour of glass.
    pub(crate) tint: [f32; 3],
}

impl Default for RayMaterial {
    fn default() -> Self {
        RayMaterial {
            surface: Surface::Program,
            opacity: 1.0,
            mirror: 0.0,
            roughness: 0.2,
            ior: 1.5,
            tint: [1.0; 3],
        }
    }
}

impl RayMaterial {
    fn new(m: &Material) -> RayMaterial {
        let usual = RayMaterial::default();
        let surface = m.surface.unwrap_or_default();
        // A surface without a highlight reflects nothing, so no rays are traced for it.
        let dull = surface == Surface::Matte || m.specular == Some(0.0);
        RayMaterial {
            surface,
            opacity: m.opacity.map_or(usual.opacity, |v| v as f32),
            mirror: if dull { 0.0 } else { m.mirror.map_or(usual.mirror, |v| v as f32) },
            roughness: m.roughness.map_or(usual.roughness, |v| v as f32),
            ior: m.ior.map_or(usual.ior, |v| v as f32),
            // Halfway to white. Two walls of a saturated colour would absorb all light.
            tint: m.color.map_or(usual.tint, |c| rgb(c).map(|v| 0.5 + 0.5 * v)),
        }
    }
}

/// Changes a draw according to the settings. Costs nothing when they change nothing.
pub(crate) fn apply(draw: &mut Draw, settings: &Settings) {
    if settings.mode == Mode::Match {
        return;
    }
    if settings.lights != Lights::default() && draw.state.lighting {
        relight(Arc::make_mut(&mut draw.state), &settings.lights);
    }
    if let (Shading::Program(program), true) =
        (&mut draw.shading, settings.lights != Lights::default())
    {
        relight_program(Arc::make_mut(program), &settings.lights);
    }
    if settings.material.is_empty() && settings.objects.is_empty() {
        return;
    }
    let material = settings.material_of(&key_of(&draw.geometry));
    if material.is_empty() {
        return;
    }
    draw.ray_material = RayMaterial::new(&material);
    match &mut draw.shading {
        Shading::Fixed => repaint(Arc::make_mut(&mut draw.attributes), &material),
        Shading::Program(program) => repaint_program(Arc::make_mut(program), &material),
    }
}

fn rgb(color: [f64; 3]) -> [f32; 3] {
    color.map(|v| v as f32)
}

fn repaint(a: &mut Attributes, m: &Material) {
    if let Some([r, g, b]) = m.color.map(rgb) {
        // Also applies where vertices have colours, or where colours are the material
        // (GL_COLOR_MATERIAL).
        let alpha = a.colors.at(0)[3];
        a.colors = Values::Constant([r, g, b, alpha]);
    }
    for side in a.materials.iter_mut().flatten() {
        if let Some(c) = m.color.map(rgb) {
            side.ambient[..3].copy_from_slice(&c);
            side.diffuse[..3].copy_from_slice(&c);
        }
        if let Some(s) = m.specular {
            side.specular[..3].fill(s as f32);
        } else if m.surface == Some(Surface::Matte) {
            side.specular[..3].fill(0.0);
        }
        if let Some(s) = m.shininess {
            side.shininess = s as f32;
        }
        if let Some(e) = m.emission {
            let glow: [f32; 3] = std::array::from_fn(|k| side.diffuse[k] * e as f32);
            side.emission[..3].copy_from_slice(&glow);
        }
    }
}

fn repaint_program(p: &mut VtkProgram, m: &Material) {
    if let Some(c) = m.color.map(rgb) {
        p.paint(c);
    }
    if let Some(s) = m.specular {
        p.specular = [s as f32; 3];
    } else if m.surface == Some(Surface::Matte) {
        p.specular = [0.0; 3];
    }
    if let Some(s) = m.shininess {
        p.specular_power = s as f32;
    }
}

fn relight(s: &mut Snapshot, l: &Lights) {
    for light in &mut s.lights {
        light.diffuse[..3]
            .iter_mut()
            .chain(&mut light.specular[..3])
            .for_each(|v| *v *= l.program as f32);
        light.ambient[..3].iter_mut().for_each(|v| *v *= l.ambient as f32);
    }
    s.model_ambient[..3].iter_mut().for_each(|v| *v *= l.ambient as f32);
    if l.added > 0.0 && s.lights.len() < MOST_LIGHTS {
        let [r, g, b] = rgb(l.added_color).map(|v| v * l.added as f32);
        let [x, y, z] = rgb(l.added_direction);
        s.lights.push(GlLight {
            diffuse: [r, g, b, 1.0],
            specular: [r, g, b, 1.0],
            // A direction, in eye space.
            position: [x, y, z, 0.0],
            spot_cutoff_deg: 180.0,
            attenuation: [1.0, 0.0, 0.0],
            ..GlLight::default()
        });
    }
}

fn relight_program(p: &mut VtkProgram, l: &Lights) {
    for light in &mut p.lights {
        light.color.iter_mut().for_each(|v| *v *= l.program as f32);
    }
    p.ambient.iter_mut().for_each(|v| *v *= l.ambient as f32);
    if l.added > 0.0 && p.lights.len() < MOST_LIGHTS {
        let length = l.added_direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        // VTK's shaders store the direction in which light travels.
        let direction = l.added_direction.map(|v| (-v / length) as f32);
        let color = rgb(l.added_color).map(|v| v * l.added as f32);
        p.lights.push(ProgramLight { direction, color, lamp: None });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::current_attributes::CurrentAttributes;

    #[test]
    fn colours_and_highlights_replace_those_of_both_sides_and_of_vertices() {
        let mut a = Attributes::constant(&CurrentAttributes::default());
        a.colors = Values::PerVertex(vec![[0.1, 0.2, 0.3, 0.5]; 3]);
        a.materials[0][1].specular = [0.7; 4];
        repaint(
            &mut a,
            &Material {
                color: Some([1.0, 0.5, 0.0]),
                emission: Some(2.0),
                specular: Some(0.0),
                ..Material::default()
            },
        );
        assert_eq!(a.colors.at(2), [1.0, 0.5, 0.0, 0.5], "alpha stays");
        for side in a.materials[0] {
            assert_eq!(
                (&side.diffuse[..3], &side.emission[..3]),
                (&[1.0, 0.5, 0.0][..], &[2.0, 1.0, 0.0][..])
            );
            assert_eq!(side.specular[..3], [0.0; 3]);
        }
        let before = a.clone();
        repaint(&mut a, &Material { shininess: Some(20.0), ..Material::default() });
        assert_eq!(
            (a.materials[0][0].shininess, a.materials[0][0].diffuse),
            (20.0, before.materials[0][0].diffuse)
        );
    }

    #[test]
    fn lights_are_dimmed_and_one_is_added_where_there_is_room() {
        let light = GlLight { diffuse: [1.0; 4], ambient: [0.5; 4], ..GlLight::default() };
        let mut s =
            Snapshot { lights: vec![light], model_ambient: [0.2; 4], ..Snapshot::default() };
        let l = Lights {
            program: 0.5,
            ambient: 0.0,
            added: 2.0,
            added_color: [1.0, 0.0, 0.0],
            ..Lights::default()
        };
        relight(&mut s, &l);
        assert_eq!(
            (s.lights[0].diffuse, s.lights[0].ambient[0], s.model_ambient[0]),
            ([0.5, 0.5, 0.5, 1.0], 0.0, 0.0)
        );
        assert_eq!((s.lights[1].diffuse, s.lights[1].position[3]), ([2.0, 0.0, 0.0, 1.0], 0.0));
        let mut full = Snapshot { lights: vec![light; MOST_LIGHTS], ..Snapshot::default() };
        relight(&mut full, &l);
        assert_eq!(full.lights.len(), MOST_LIGHTS);
    }
}

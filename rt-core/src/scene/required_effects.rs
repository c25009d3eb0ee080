//! Finds the effects that a scene needs, from its lights, materials and attributes.

use super::Scene;
use crate::colormap::ColorMap;
use crate::effects::{Effects, reflection_of};
use crate::light::LightKind;
use crate::material::{ColorSource, Material, SurfaceModel};
use std::sync::Arc;

impl Scene {
    /// Whether there is ambient light or an environment that is not black.
    pub(crate) fn has_ambient(&self) -> bool {
        self.lights.iter().any(|l| matches!(l.kind, LightKind::Ambient) && l.color != [0.0; 3])
            || self.environment.as_ref().is_some_and(|e| !e.is_black())
    }

    /// Whether the opacity of instance `i`, whose material is of this `class`, can let light
    /// through.
    fn may_be_transparent(&self, i: usize, class: OpacityClass) -> bool {
        match class {
            OpacityClass::Opaque => false,
            OpacityClass::Transparent => true,
            OpacityClass::ByAttribute => {
                let (a, geometry) = (&self.appearances[i], self.world.instances()[i].geometry);
                let own = self.geometry_colors.get(geometry).is_none_or(|c| c.transparent);
                if a.colors.is_some() { a.color_summary.transparent } else { own }
            }
        }
    }
}

/// Opacity of a material, as far as it is the same for all its instances.
#[derive(Clone, Copy, PartialEq)]
enum OpacityClass {
    Opaque,
    Transparent,
    /// Depends on the colours of the instance.
    ByAttribute,
}

/// Opacity class of each material. A colour map that consecutive materials share is inspected once.
fn opacity_classes(materials: &[Material]) -> Vec<OpacityClass> {
    let mut last: Option<(&Arc<ColorMap>, bool)> = None;
    let mut opacity_classes = Vec::with_capacity(materials.len());
    for m in materials {
        let by_color = match &m.color_source {
            ColorSource::Attribute => OpacityClass::ByAttribute,
            ColorSource::Constant => OpacityClass::Opaque,
            ColorSource::Scalars(map) => {
                let transparent = match last {
                    Some((known, answer)) if Arc::ptr_eq(known, map) => answer,
                    _ => map.colors.iter().any(|c| c[3] < 1.0) || map.nan_color[3] < 1.0,
                };
                last = Some((map, transparent));
                if transparent { OpacityClass::Transparent } else { OpacityClass::Opaque }
            }
            ColorSource::Texture(t) if t.has_transparency() => OpacityClass::Transparent,
            ColorSource::Texture(_) => OpacityClass::Opaque,
        };
        opacity_classes.push(if m.opacity < 1.0 || m.culls() {
            OpacityClass::Transparent
        } else {
            by_color
        });
    }
    opacity_classes
}

/// For each instance, whether light can pass through it in a frame with these effects.
pub(crate) fn transmits_light(scene: &Scene, effects: Effects) -> Vec<bool> {
    let opacity_classes = opacity_classes(&scene.materials);
    let count = scene.appearances.len().min(scene.world.instances().len());
    let (glass, alpha) =
        (effects.contains(Effects::REFRACTION), effects.contains(Effects::TRANSPARENCY));
    let passes = |i: usize| {
        let material = scene.appearances[i].material;
        let dielectric = matches!(scene.materials[material].model, SurfaceModel::Dielectric { .. });
        glass && dielectric || alpha && scene.may_be_transparent(i, opacity_classes[material])
    };
    (0..count).map(passes).collect()
}

impl Effects {
    /// The effects without which `scene` would look different, determined from its lights,
    /// materials, attributes and volumes. The lens belongs to the camera
    /// ([`Effects::required_by_camera`]), and path tracing is a render option.
    pub fn required_by(scene: &Scene) -> Effects {
        requirements(scene)
    }
}

fn requirements(scene: &Scene) -> Effects {
    let mut used = vec![false; scene.materials.len()];
    let mut transparent = false;
    // A glyph plot has many instances, but their requirements depend only on material and geometry.
    let opacity_classes = opacity_classes(&scene.materials);
    for i in 0..scene.appearances.len().min(scene.world.instances().len()) {
        let material = scene.appearances[i].material;
        if let Some(u) = used.get_mut(material) {
            *u = true;
            transparent = transparent || scene.may_be_transparent(i, opacity_classes[material]);
        }
    }
    let used = || scene.materials.iter().zip(&used).filter(|(_, u)| **u).map(|(m, _)| m);
    let lit =
        used().any(|m| !matches!(m.model, SurfaceModel::Unlit | SurfaceModel::Dielectric { .. }));
    let lights = || scene.lights.iter().filter(|l| lit && l.casts_shadows());
    let dielectric = used().any(|m| matches!(m.model, SurfaceModel::Dielectric { .. }));
    // Where roughness varies, it can have any value somewhere.
    let reflects = |m: &Material, effect| {
        m.reflection_roughness().is_some_and(|r| m.maps.is_some() || reflection_of(r) == effect)
    };
    Effects::NONE
        .with_if(lights().next().is_some(), Effects::SHADOWS)
        .with_if(lights().any(|l| l.size() > 0.0), Effects::SOFT_SHADOWS)
        .with_if(
            lit && scene.ambient_occlusion.is_some() && scene.has_ambient(),
            Effects::AMBIENT_OCCLUSION,
        )
        .with_if(
            dielectric || used().any(|m| reflects(m, Effects::REFLECTION)),
            Effects::REFLECTION,
        )
        .with_if(
            used().any(|m| reflects(m, Effects::GLOSSY_REFLECTION)),
            Effects::GLOSSY_REFLECTION,
        )
        .with_if(dielectric, Effects::REFRACTION)
        .with_if(transparent, Effects::TRANSPARENCY)
        .with_if(!scene.volumes.is_empty(), Effects::VOLUMES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Geometry;
    use crate::camera::Camera;
    use crate::environment::Environment;
    use crate::render::{RenderOptions, render};
    use crate::scene::{Appearance, SceneBuilder};
    use crate::test_shapes::sphere;
    use crate::texture::Texture;
    use glam::{DAffine3, DVec3, Vec2, Vec3};

    #[test]
    fn opaque_textures_are_not_looked_through_for_every_instance_and_frame() {
        let mut b = SceneBuilder::new();
        let mut mesh = sphere(1);
        mesh.texcoords = Some(vec![Vec2::ZERO; mesh.positions.len()]);
        let g = b.geometry(Geometry::Mesh(Arc::new(mesh)));
        let texture = Arc::new(Texture::from_linear(8, 8, vec![[0.5, 0.5, 0.5, 1.0]; 64]).unwrap());
        let m = b.material(Material::matte([1.0; 3]).textured(texture.clone()));
        for k in 0..500 {
            let place = DAffine3::from_translation(DVec3::X * 3.0 * k as f64);
            b.instance(g, place, Appearance::new(m));
        }
        b.environment = Some(Environment::Image { image: texture, up: Vec3::Z, scale: 0.0 });
        let before = Texture::scans();
        let scene = b.build().unwrap();
        let eye = DVec3::new(0.0, 0.0, 9.0);
        let camera =
            Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.6, 1.0, [0.1, 100.0]).unwrap();
        for _ in 0..3 {
            render(&scene, &camera, &RenderOptions::new(8, 8)).unwrap();
        }
        assert_eq!(Texture::scans() - before, 0, "it was known when the texture was made");
        assert!(!Effects::required_by(&scene).contains(Effects::TRANSPARENCY));
    }

    #[test]
    fn a_texture_with_a_hole_makes_its_instances_transparent() {
        let mut b = SceneBuilder::new();
        let g = b.geometry(Geometry::Mesh(Arc::new(sphere(1))));
        let mut texels = vec![[0.5, 0.5, 0.5, 1.0]; 64];
        texels[63][3] = 0.9;
        let hole = Texture::from_linear(8, 8, texels).unwrap();
        let solid = b.material(Material::matte([1.0; 3]));
        let holed = b.material(Material::matte([1.0; 3]).textured(hole));
        let glass = b.material(Material::dielectric(1.5));
        for m in [solid, holed, glass] {
            b.instance(g, DAffine3::IDENTITY, Appearance::new(m));
        }
        let mut scene = b.build().unwrap();
        let through = |scene: &Scene, effects| transmits_light(scene, effects);
        let both = Effects::TRANSPARENCY | Effects::REFRACTION;
        assert_eq!(through(&scene, both), [false, true, true]);
        assert_eq!(through(&scene, Effects::REFRACTION), [false, false, true]);
        assert_eq!(through(&scene, Effects::TRANSPARENCY), [false, true, false]);
        // Another texture instead of this one has its own result.
        let whole = Texture::from_linear(1, 1, vec![[1.0; 4]]).unwrap();
        scene.materials[holed] = Material::matte([1.0; 3]).textured(whole);
        assert_eq!(through(&scene, both), [false, false, true]);
    }
}

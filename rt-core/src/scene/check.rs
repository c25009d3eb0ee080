//! Checks whether a scene can be rendered: all indices and numbers must be valid.

use super::{Scene, SceneError};
use crate::bvh::Geometry;
use crate::light::Light;
use crate::mesh::PerElement;

/// Field, value found, and what it must be.
type Fault = (&'static str, String, &'static str);

/// Largest distance of a light. Shading uses f32, where lights farther away would be at infinity
/// and give no light.
const FARTHEST: f64 = 1e37;

impl Scene {
    /// Checks all indices and numbers of the scene.
    pub fn check(&self) -> Result<(), SceneError> {
        let (appearances, instances) = (self.appearances.len(), self.world.instances().len());
        if appearances != instances {
            return Err(SceneError::Appearances { appearances, instances });
        }
        let (expected, found) = (self.geometry_colors.len(), self.world.geometries().len());
        if expected != found {
            return Err(SceneError::OtherWorld { expected, found });
        }
        let slices = |g: &Geometry| matches!(g, Geometry::Slices(_));
        if let Some(geometry) = self.world.geometries().iter().position(slices) {
            return Err(SceneError::WithoutArrays { geometry });
        }
        self.check_surroundings()?;
        for (index, m) in self.materials.iter().enumerate() {
            m.check().map_err(|(field, value, rule)| SceneError::OutOfRange {
                what: "material",
                index,
                field,
                value,
                rule,
            })?;
        }
        for (index, l) in self.lights.iter().enumerate() {
            check_light(l).map_err(|(field, value, rule)| SceneError::OutOfRange {
                what: "light",
                index,
                field,
                value,
                rule,
            })?;
        }
        if let Some(ao) = self.ambient_occlusion {
            let error = |field, value, rule| SceneError::OutOfRange {
                what: "ambient occlusion",
                index: 0,
                field,
                value,
                rule,
            };
            if ao.distance.is_nan() || ao.distance <= 0.0 {
                return Err(error(
                    "distance",
                    ao.distance.to_string(),
                    "positive (infinity for no limit)",
                ));
            }
            if ao.rays == 0 {
                return Err(error(
                    "rays",
                    "0".into(),
                    "at least 1; leave ambient occlusion out to have none",
                ));
            }
        }
        for (index, v) in self.volumes.iter().enumerate() {
            let determinant = v.world_from_object.matrix3.determinant();
            if !(v.world_from_object.is_finite() && determinant != 0.0 && determinant.is_finite()) {
                let (field, value, rule) = (
                    "world_from_object",
                    format!("{:?}", v.world_from_object),
                    "finite and invertible",
                );
                return Err(SceneError::OutOfRange { what: "volume", index, field, value, rule });
            }
        }
        for (appearance, a) in self.appearances.iter().enumerate() {
            let (material, count) = (a.material, self.materials.len());
            if material >= count {
                return Err(SceneError::NoSuchMaterial { appearance, material, count });
            }
            let geometry = &self.world.geometries()[self.world.instances()[appearance].geometry];
            let expected = |per| match (geometry, per) {
                (Geometry::Mesh(mesh), PerElement::Vertex) => mesh.positions.len(),
                // Shapes have one value per primitive, given either per vertex or per primitive.
                _ => geometry.num_primitives(),
            };
            let colors = a.colors.as_ref().map(|c| ("colors", expected(c.per), c.values.len()));
            let scalars = a.scalars.as_ref().map(|s| ("scalars", expected(s.per), s.values.len()));
            for (field, expected, found) in colors.into_iter().chain(scalars) {
                if expected != found {
                    return Err(SceneError::AttributeLength { appearance, field, expected, found });
                }
            }
            if let (Some(c), Some(i)) = (&a.colors, a.color_summary.unusable) {
                return Err(unusable_color("appearance", appearance, i, c.values[i]));
            }
        }
        for (index, (facts, g)) in
            self.geometry_colors.iter().zip(self.world.geometries()).enumerate()
        {
            if let (Some(i), Geometry::Mesh(mesh)) = (facts.unusable, g)
                && let Some(c) = mesh.colors.as_ref().and_then(|c| c.values.get(i))
            {
                return Err(unusable_color("geometry", index, i, *c));
            }
        }
        Ok(())
    }

    /// Checks the environment and the background.
    fn check_surroundings(&self) -> Result<(), SceneError> {
        let error = |what| {
            move |(field, value, rule): Fault| SceneError::OutOfRange {
                what,
                index: 0,
                field,
                value,
                rule,
            }
        };
        if let Some(e) = &self.environment {
            e.check().map_err(error("environment"))?;
        }
        self.background.check().map_err(error("background"))
    }
}

fn unusable_color(what: &'static str, index: usize, place: usize, color: [f32; 4]) -> SceneError {
    SceneError::OutOfRange {
        what,
        index,
        field: "colors",
        value: format!("{color:?} at place {place}"),
        rule: "finite in every channel: replace such colours",
    }
}

fn check_light(l: &Light) -> Result<(), Fault> {
    use crate::light::LightKind as K;
    let color = |field, c: [f32; 3]| {
        let ok = c.iter().all(|v| v.is_finite());
        if ok { Ok(()) } else { Err((field, format!("{c:?}"), "finite in every channel")) }
    };
    color("color", l.color)?;
    color("highlight_color", l.highlight_color.unwrap_or(l.color))?;
    let ok = l.attenuation.iter().all(|v| v.is_finite() && *v >= 0.0);
    if !(ok && l.attenuation != [0.0; 3]) {
        let rule = "finite and not negative, with one number above 0; [1, 0, 0] for none";
        return Err(("attenuation", format!("{:?}", l.attenuation), rule));
    }
    let size = l.size();
    if !(size >= 0.0 && size.is_finite()) {
        return Err(("radius", size.to_string(), "0 or positive, finite"));
    }
    let vector = |field, v: glam::DVec3| {
        // A vector that cannot be normalised has no direction and would give no light.
        let ok = v.is_finite() && v.try_normalize().is_some();
        let rule = "finite and not zero, 1e-150 to 1e150 long";
        if ok { Ok(()) } else { Err((field, v.to_string(), rule)) }
    };
    let point = |v: glam::DVec3| {
        let ok = v.abs().max_element() <= FARTHEST;
        let rule = "finite, each coordinate within 1e37; make light from farther directional";
        if ok { Ok(()) } else { Err(("position", v.to_string(), rule)) }
    };
    match l.kind {
        K::Ambient => Ok(()),
        K::Directional { to_light, angular_radius_rad } => {
            vector("to_light", to_light)?;
            let ok = angular_radius_rad < std::f64::consts::FRAC_PI_2;
            if ok {
                Ok(())
            } else {
                Err(("angular_radius_rad", angular_radius_rad.to_string(), "below pi/2"))
            }
        }
        K::Point { position, .. } => point(position),
        K::Spot { position, direction, cutoff_rad, exponent, .. } => {
            point(position)?;
            vector("direction", direction)?;
            if !(cutoff_rad > 0.0 && cutoff_rad <= std::f64::consts::PI) {
                return Err(("cutoff_rad", cutoff_rad.to_string(), "above 0 and at most pi"));
            }
            let ok = exponent >= 0.0 && exponent.is_finite();
            if ok {
                Ok(())
            } else {
                Err(("exponent", exponent.to_string(), "0 or positive, finite"))
            }
        }
        K::Cone { position, direction, inner_rad, outer_rad } => {
            point(position)?;
            vector("direction", direction)?;
            if !(outer_rad > 0.0 && outer_rad <= std::f64::consts::PI) {
                return Err(("outer_rad", outer_rad.to_string(), "above 0 and at most pi"));
            }
            let ok = (0.0..=outer_rad).contains(&inner_rad);
            if ok { Ok(()) } else { Err(("inner_rad", inner_rad.to_string(), "0 to outer_rad")) }
        }
        K::Ring { position, direction, inner_radius, radius, inner_rad, outer_rad } => {
            point(position)?;
            vector("direction", direction)?;
            if radius <= 0.0 {
                return Err(("radius", radius.to_string(), "positive: a ring needs an area"));
            }
            if !(0.0..radius).contains(&inner_radius) {
                return Err((
                    "inner_radius",
                    inner_radius.to_string(),
                    "0 or positive, below the radius",
                ));
            }
            if !(outer_rad > 0.0 && outer_rad <= std::f64::consts::FRAC_PI_2) {
                return Err(("outer_rad", outer_rad.to_string(), "above 0 and at most pi/2"));
            }
            let ok = (0.0..=outer_rad).contains(&inner_rad);
            if ok { Ok(()) } else { Err(("inner_rad", inner_rad.to_string(), "0 to outer_rad")) }
        }
        K::Quad { corner, edges: [a, b], .. } => {
            point(corner)?;
            vector("edge 1", a)?;
            vector("edge 2", b)?;
            vector("edge 1 x edge 2", a.normalize().cross(b.normalize()))
        }
        K::Disk { position, direction, radius } => {
            point(position)?;
            vector("direction", direction)?;
            if radius > 0.0 {
                Ok(())
            } else {
                Err(("radius", radius.to_string(), "positive: a disk needs an area"))
            }
        }
    }
}

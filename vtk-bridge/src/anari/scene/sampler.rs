//! Samplers: convert an attribute to a value through an image, a list or a matrix.

use super::Diagnostics;
use super::attribute::{Domain, HitPoint, Source};
use crate::anari::object::Object;
use crate::anari::schema::ATTRIBUTES;
use rt_core::glam::{DMat4, DVec4, Vec2};
use rt_core::texture::{Filter, Texture, Wrap};
use std::sync::Arc;

/// A sampler, ready for evaluation.
#[derive(Clone)]
pub(crate) struct Sampler {
    input: Source,
    step: Step,
    out_transform: DMat4,
    out_offset: DVec4,
}

#[derive(Clone)]
enum Step {
    /// The attribute itself.
    Nothing,
    /// Indexed by the primitive.
    Primitive { values: Arc<Vec<[f32; 4]>>, offset: u64 },
    /// An image of one to three dimensions.
    Image(Arc<Image>),
}

struct Image {
    dims: [usize; 3],
    dimensions: usize,
    texels: Vec<[f32; 4]>,
    wrap: [Wrap; 3],
    /// Dimensions outside of which `border_color` applies.
    border: [bool; 3],
    border_color: [f32; 4],
    filter: Filter,
    in_transform: DMat4,
    in_offset: DVec4,
}

fn matrix(o: &Object, name: &str) -> DMat4 {
    DMat4::from_cols_array(&o.vector(name, DMat4::IDENTITY.to_cols_array()))
}

fn wide(v: [f32; 4]) -> DVec4 {
    DVec4::new(v[0].into(), v[1].into(), v[2].into(), v[3].into())
}

impl Sampler {
    /// Returns `None`, with a diagnostic, for a sampler that cannot be used.
    pub(crate) fn of(
        sampler: &Object,
        geometry: &Object,
        instance: Option<&Object>,
        diagnostics: &mut Diagnostics,
    ) -> Option<Sampler> {
        if !sampler.known {
            return None;
        }
        let name = sampler.text("inAttribute").unwrap_or_else(|| "attribute0".into());
        let input = if sampler.subtype == "primitive" {
            Source::Uniform([0.0; 4])
        } else {
            let input = Source::of(&name, geometry, instance);
            if input.is_none() {
                diagnostics.error(
                    sampler,
                    format!(
                        "`inAttribute` is \"{name}\", which is no attribute; use one of {:?}",
                        ATTRIBUTES
                    ),
                );
            }
            input?
        };
        let step = match sampler.subtype.as_str() {
            "transform" => Step::Nothing,
            "primitive" => {
                let values = sampler.object("array").and_then(|a| a.with_array(|a| a.attributes()));
                let Some(values) = values else {
                    diagnostics.error(sampler, "`array` is not set, so there is nothing to sample");
                    return None;
                };
                let offset = sampler.numbers("inOffset").map_or(0, |v| v[0] as u64);
                Step::Primitive { values: values.into(), offset }
            }
            _ => Step::Image(Arc::new(image(sampler, diagnostics)?)),
        };
        let (out_transform, out_offset) = (
            matrix(sampler, "outTransform"),
            DVec4::from_array(sampler.vector("outOffset", [0.0; 4])),
        );
        Some(Sampler { input, step, out_transform, out_offset })
    }

    pub(crate) fn at(&self, p: &HitPoint<'_>) -> [f32; 4] {
        let value = match &self.step {
            Step::Nothing => self.input.at(p),
            Step::Primitive { values, offset } => {
                let i = u64::from(p.topology.number(p.primitive)).saturating_add(*offset);
                usize::try_from(i)
                    .ok()
                    .and_then(|i| values.get(i))
                    .copied()
                    .unwrap_or([0.0, 0.0, 0.0, 1.0])
            }
            Step::Image(image) => image.at(image.coordinate(self.input.at(p))),
        };
        self.output(value)
    }

    fn output(&self, value: [f32; 4]) -> [f32; 4] {
        (self.out_transform * wide(value) + self.out_offset).as_vec4().to_array()
    }

    pub(crate) fn domain(&self) -> Domain {
        match &self.step {
            Step::Nothing => self.input.domain(),
            Step::Primitive { .. } => Domain::Face,
            Step::Image(image) => match self.input.domain() {
                Domain::Linear if image.fits_a_texture() => Domain::Texture,
                Domain::Linear => Domain::Hit,
                other => other,
            },
        }
    }

    /// The input attribute.
    pub(crate) fn attribute(&self, p: &HitPoint<'_>) -> [f32; 4] {
        self.input.at(p)
    }

    /// The renderer's texture, with `finish` applied to every texel, for domain
    /// [`Domain::Texture`].
    pub(crate) fn texture(&self, finish: impl Fn([f32; 4]) -> [f32; 4]) -> Option<Texture> {
        let Step::Image(image) = &self.step else { return None };
        let texels = image.texels.iter().map(|t| finish(self.output(*t))).collect();
        let mut texture = Texture::from_linear(image.dims[0], image.dims[1], texels).ok()?;
        texture.wrap = [image.wrap[0], image.wrap[1]];
        texture.filter = image.filter;
        Some(texture)
    }

    /// Texture coordinates at a vertex.
    pub(crate) fn coordinate(&self, p: &HitPoint<'_>) -> Vec2 {
        match &self.step {
            Step::Image(image) => {
                let c = image.coordinate(self.input.at(p));
                Vec2::new(c.x as f32, if image.dimensions == 1 { 0.5 } else { c.y as f32 })
            }
            _ => Vec2::ZERO,
        }
    }
}

fn image(sampler: &Object, diagnostics: &mut Diagnostics) -> Option<Image> {
    let dimensions = match sampler.subtype.as_str() {
        "image1D" => 1,
        "image2D" => 2,
        _ => 3,
    };
    let read = sampler.object("image").and_then(|a| {
        a.with_array(|a| {
            let dims = if dimensions == 1 { [a.len(), 1, 1] } else { a.dims };
            (dims, a.attributes())
        })
    });
    let Some((dims, texels)) = read.filter(|(_, t)| !t.is_empty()) else {
        diagnostics
            .error(sampler, "`image` is not set or has no texels, so there is nothing to sample");
        return None;
    };
    let names: &[&str] =
        if dimensions == 1 { &["wrapMode"] } else { &["wrapMode1", "wrapMode2", "wrapMode3"] };
    let (mut wrap, mut border) = ([Wrap::Clamp; 3], [false; 3]);
    for (d, name) in names.iter().enumerate().take(dimensions) {
        // The schema rejects everything else.
        match sampler.text(name).as_deref() {
            Some("repeat") => wrap[d] = Wrap::Repeat,
            Some("mirrorRepeat") => wrap[d] = Wrap::Mirror,
            Some("clampToBorder") => border[d] = true,
            _ => {}
        }
    }
    let border_color = sampler.vector("borderColor", [0.0; 4]).map(|v| v as f32);
    let filter = if sampler.text("filter").as_deref() == Some("nearest") {
        Filter::Nearest
    } else {
        Filter::Bilinear
    };
    let in_offset = DVec4::from_array(sampler.vector("inOffset", [0.0; 4]));
    Some(Image {
        dims,
        dimensions,
        texels,
        wrap,
        border,
        border_color,
        filter,
        in_transform: matrix(sampler, "inTransform"),
        in_offset,
    })
}

impl Image {
    /// Matrices are applied to the attribute without division by its fourth component, so
    /// coordinates are linear wherever the attribute is.
    fn fits_a_texture(&self) -> bool {
        let affine = self.in_transform.is_finite() && self.in_offset.is_finite();
        affine && self.dimensions < 3 && self.border == [false; 3]
    }

    fn coordinate(&self, attribute: [f32; 4]) -> DVec4 {
        self.in_transform * wide(attribute) + self.in_offset
    }

    /// Texel centres are at (i + ½)/n along each dimension.
    fn at(&self, c: DVec4) -> [f32; 4] {
        let coordinate = c.to_array();
        let mut low = [0i64; 3];
        let mut part = [0f64; 3];
        for d in 0..self.dimensions {
            let finite = if coordinate[d].is_finite() { coordinate[d] } else { 0.0 };
            // Beyond 2^52 there are no fractions left to interpolate with.
            let x = (finite * self.dims[d] as f64).clamp(-4e15, 4e15);
            let x = if self.filter == Filter::Nearest { x } else { x - 0.5 };
            low[d] = x.floor() as i64;
            part[d] = if self.filter == Filter::Nearest { 0.0 } else { x - x.floor() };
        }
        let mut sum = [0f64; 4];
        for corner in 0..1usize << self.dimensions {
            let mut weight = 1.0;
            let mut index = [0usize; 3];
            let mut outside = false;
            for d in 0..self.dimensions {
                let up = corner >> d & 1;
                weight *= if up == 1 { part[d] } else { 1.0 - part[d] };
                let i = low[d] + up as i64;
                outside |= self.border[d] && !(0..self.dims[d] as i64).contains(&i);
                index[d] = place(i, self.dims[d], self.wrap[d]);
            }
            if weight == 0.0 {
                continue;
            }
            let texel = if outside {
                self.border_color
            } else {
                self.texels[(index[2] * self.dims[1] + index[1]) * self.dims[0] + index[0]]
            };
            (0..4).for_each(|k| sum[k] += weight * f64::from(texel[k]));
        }
        sum.map(|v| v as f32)
    }
}

/// Texel `i` of a row of `n`; outside the row, `wrap` decides.
fn place(i: i64, n: usize, wrap: Wrap) -> usize {
    let n = n as i64;
    let i = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let m = i.rem_euclid(2 * n);
            if m < n { m } else { 2 * n - 1 - m }
        }
    };
    i as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(dims: [usize; 3], dimensions: usize, wrap: Wrap, filter: Filter) -> Image {
        let texels = (0..dims.iter().product()).map(|i| [i as f32, 0.0, 0.0, 1.0]).collect();
        let (in_transform, in_offset) = (DMat4::IDENTITY, DVec4::ZERO);
        let (border, border_color) = ([false; 3], [0.0; 4]);
        Image {
            dims,
            dimensions,
            texels,
            wrap: [wrap; 3],
            border,
            border_color,
            filter,
            in_transform,
            in_offset,
        }
    }

    #[test]
    fn block_of_texels_is_exact_at_centres_and_linear_between() {
        let block = ramp([2, 2, 2], 3, Wrap::Clamp, Filter::Bilinear);
        let at = |x: f64, y: f64, z: f64| block.at(DVec4::new(x, y, z, 1.0))[0];
        assert_eq!(
            (at(0.25, 0.25, 0.25), at(0.75, 0.25, 0.25), at(0.25, 0.25, 0.75)),
            (0.0, 1.0, 4.0)
        );
        assert_eq!(at(0.5, 0.5, 0.5), 3.5);
        assert_eq!(at(f64::NAN, 9.0, -9.0), 2.0);
    }

    #[test]
    fn wrapping_far_outside_does_not_overflow() {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            for filter in [Filter::Nearest, Filter::Bilinear] {
                let row = ramp([3, 1, 1], 1, wrap, filter);
                for x in [1e30, -1e30, f64::MAX] {
                    let v = row.at(DVec4::new(x, 0.0, 0.0, 1.0))[0];
                    assert!((0.0..=2.0).contains(&v), "{wrap:?} {filter:?} {x}: {v}");
                }
            }
        }
    }
}

//! Reuses images of unchanged frames. Programs draw the same content again when a window is
//! uncovered, when two events come for one change (geomview), or because they draw all the time. A
//! traced image is kept until the end of the following frame.
//!
//! Two frames are equal when everything that rays and lighting read is equal: geometry by its key,
//! attributes by their version or bit by bit, state, matrices, textures, settings. Equality is
//! never inferred from samples.
//!
//! Draws whose order matters are kept one by one, with all their layers. Programs that draw stencil
//! values, shadows or user interfaces draw the same rectangle again and again, sometimes in another
//! colour. Where the draw depends only on that colour (no light, texture or fog), the layers get
//! the new one.

use crate::capture::draw::{Attributes, Draw, Shading, TexturedDraw, Values};
use crate::capture::vertex_recorder::same_bits;
use crate::host::config::{Config, Mode, Settings};
use crate::present::effect_image::bytes as bytes_of;
use crate::state::snapshot::Snapshot;
use crate::trace::overrides::RayMaterial;
use crate::trace::texturing::Image;
use crate::trace::{Layer, UNCOVERED};
use std::sync::Arc;

/// Attributes of at most this many bytes are kept for a comparison.
const MOST_BYTES: usize = 1 << 16;
/// The number of images that are kept. A frame may have several parts.
const MOST_PICTURES: usize = 4;
/// The number of kept draws whose order matters. Each new one is compared with all of them.
const MOST_ORDERED: usize = 16;
/// The total number of their pixels.
const MOST_PIXELS: usize = 1 << 24;

/// Everything that the image of one draw depends on.
pub(crate) struct DrawKey {
    geometry: u128,
    state: Arc<Snapshot>,
    clip_from_object: [u32; 16],
    ray_material: RayMaterial,
    attributes: AttributesKey,
    image: Option<Arc<Image>>,
}

enum AttributesKey {
    Version(u64),
    Content(Arc<Attributes>),
    /// Nothing but one colour, which may be another.
    Plain,
}

/// The colour of all fragments of a draw, if it depends on nothing else.
fn plain_color(d: &Draw) -> Option<[u8; 4]> {
    let s = &*d.state;
    let plain = matches!(d.shading, Shading::Fixed)
        && !s.lighting
        && s.texture.is_none()
        && s.fog.is_none();
    match d.attributes.colors {
        Values::Constant(color) if plain => Some(bytes_of(color)),
        _ => None,
    }
}

impl DrawKey {
    /// What draws are made of; `None` when that cannot be compared, or costs too much.
    pub(crate) fn of(draws: &[TexturedDraw], settings: &Settings) -> Option<Vec<DrawKey>> {
        if settings.mode != Mode::Match {
            return None;
        }
        draws.iter().map(|(d, image)| DrawKey::of_draw(d, image.as_ref())).collect()
    }

    fn of_draw(d: &Draw, image: Option<&Arc<Image>>) -> Option<DrawKey> {
        let attributes = match d.attributes.version {
            _ if !matches!(d.shading, Shading::Fixed) => return None,
            0 if bytes(&d.attributes) > MOST_BYTES => return None,
            0 => AttributesKey::Content(d.attributes.clone()),
            version => AttributesKey::Version(version),
        };
        Some(DrawKey {
            geometry: d.geometry.key,
            state: d.state.clone(),
            clip_from_object: d.clip_from_object.map(f32::to_bits),
            ray_material: d.ray_material,
            attributes,
            image: image.cloned(),
        })
    }

    fn matches(&self, d: &Draw, image: Option<&Arc<Image>>) -> bool {
        let images = match (&self.image, image) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        images
            && matches!(d.shading, Shading::Fixed)
            && self.geometry == d.geometry.key
            && self.clip_from_object == d.clip_from_object.map(f32::to_bits)
            && self.ray_material == d.ray_material
            && *self.state == *d.state
            && match &self.attributes {
                AttributesKey::Version(version) => *version == d.attributes.version,
                AttributesKey::Content(a) => same(a, &d.attributes, d.state.texture.is_some()),
                AttributesKey::Plain => plain_color(d).is_some(),
            }
    }
}

fn bytes(a: &Attributes) -> usize {
    fn of<const N: usize>(v: &Values<N>) -> usize {
        match v {
            Values::Constant(_) => 0,
            Values::PerVertex(all) => 4 * N * all.len(),
            // Long arrays are shared with those who keep them by their content.
            Values::Packed(p) => {
                if crate::capture::attribute_cache::is_shared(p) {
                    0
                } else {
                    p.bytes.len()
                }
            }
        }
    }
    of(&a.normals)
        + of(&a.colors)
        + of(&a.tex)
        + size_of_val(&a.materials[..])
        + 4 * a.material_of.len()
}

/// Without a texture, texture coordinates do not matter. They are leftovers of earlier draws.
fn same(a: &Attributes, b: &Attributes, textured: bool) -> bool {
    fn values<const N: usize>(a: &Values<N>, b: &Values<N>) -> bool {
        match (a, b) {
            (Values::Constant(a), Values::Constant(b)) => same_bits(&[*a], &[*b]),
            (Values::PerVertex(a), Values::PerVertex(b)) => same_bits(a, b),
            (Values::Packed(a), Values::Packed(b)) => {
                Arc::ptr_eq(a, b) || !crate::capture::attribute_cache::is_shared(a) && a == b
            }
            _ => false,
        }
    }
    a.materials == b.materials
        && a.material_of == b.material_of
        && values(&a.normals, &b.normals)
        && values(&a.colors, &b.colors)
        && (!textured || values(&a.tex, &b.tex))
}

struct ReusableImage {
    drawn: Vec<DrawKey>,
    config: Arc<Config>,
    layer: Layer,
    /// The age in frames.
    age: u32,
}

/// A draw whose order matters.
struct ReusableLayers {
    drawn: DrawKey,
    config: Arc<Config>,
    layers: Vec<Layer>,
    /// The age in frames.
    age: u32,
}

/// The latest images.
#[derive(Default)]
pub(crate) struct FrameReuse {
    /// In order of use, the latest last.
    pictures: Vec<ReusableImage>,
    /// Likewise.
    ordered: Vec<ReusableLayers>,
}

impl FrameReuse {
    /// The image of these draws, lent until [`FrameReuse::put_back`].
    pub(crate) fn find(&mut self, draws: &[TexturedDraw], config: &Arc<Config>) -> Option<Layer> {
        let is = |p: &ReusableImage| {
            p.drawn.len() == draws.len()
                && Arc::ptr_eq(&p.config, config)
                && p.drawn.iter().zip(draws).all(|(was, (d, image))| was.matches(d, image.as_ref()))
        };
        let i = self.pictures.iter().position(is)?;
        let mut found = self.pictures.remove(i);
        let layer = std::mem::take(&mut found.layer);
        found.age = 0;
        self.pictures.push(found);
        Some(layer)
    }

    /// Takes back the image that [`FrameReuse::find`] lent.
    pub(crate) fn put_back(&mut self, layer: Layer) {
        if let Some(p) = self.pictures.last_mut() {
            p.layer = layer;
        }
    }

    /// Keeps the image of these draws.
    pub(crate) fn keep(&mut self, drawn: Option<Vec<DrawKey>>, config: &Arc<Config>, layer: Layer) {
        let Some(drawn) = drawn else { return };
        let new = ReusableImage { drawn, config: config.clone(), layer, age: 0 };
        self.pictures.push(new);
        let pixels = |all: &[ReusableImage]| all.iter().map(|p| p.layer.depth.len()).sum::<usize>();
        while self.pictures.len() > MOST_PICTURES || pixels(&self.pictures) > MOST_PIXELS {
            self.pictures.remove(0);
        }
    }

    /// Ends a frame and drops images that are too old.
    pub(crate) fn frame_done(&mut self) {
        self.pictures.iter_mut().for_each(|p| p.age += 1);
        self.pictures.retain(|p| p.age < 2);
        self.ordered.iter_mut().for_each(|o| o.age += 1);
        self.ordered.retain(|o| o.age < 2);
    }

    /// The layers of a draw whose order matters, in its colour, lent until
    /// [`FrameReuse::keep_ordered`] has them again.
    pub(crate) fn find_ordered(
        &mut self,
        draw: &Draw,
        image: Option<&Arc<Image>>,
        config: &Arc<Config>,
    ) -> Option<Vec<Layer>> {
        let is =
            |o: &ReusableLayers| Arc::ptr_eq(&o.config, config) && o.drawn.matches(draw, image);
        let i = self.ordered.iter().position(is)?;
        let mut layers = self.ordered.remove(i).layers;
        if let Some(color) = plain_color(draw) {
            layers.iter_mut().flat_map(|l| &mut l.color).for_each(|c| *c = color);
        }
        Some(layers)
    }

    /// Keeps the layers of a draw whose order matters.
    pub(crate) fn keep_ordered(
        &mut self,
        draw: &Draw,
        image: Option<&Arc<Image>>,
        config: &Arc<Config>,
        layers: Vec<Layer>,
    ) {
        let color = plain_color(draw);
        let is_plain = |color: [u8; 4]| {
            let fragments = layers.iter().flat_map(|l| l.color.iter().zip(&l.depth));
            fragments.filter(|(_, depth)| **depth != UNCOVERED).all(|(c, _)| *c == color)
        };
        let Some(mut drawn) = DrawKey::of_draw(draw, image) else { return };
        if color.is_some_and(is_plain) {
            drawn.attributes = AttributesKey::Plain;
        }
        self.ordered.push(ReusableLayers { drawn, config: config.clone(), layers, age: 0 });
        let pixels = |all: &[ReusableLayers]| {
            all.iter().flat_map(|o| &o.layers).map(|l| l.depth.len()).sum::<usize>()
        };
        while self.ordered.len() > MOST_ORDERED || pixels(&self.ordered) > MOST_PIXELS {
            self.ordered.remove(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::geometry_cache::GeometryCache;
    use crate::state::current_attributes::CurrentAttributes;
    use crate::trace::Rect;

    fn config(mode: Mode) -> Arc<Config> {
        let settings = Settings { mode, ..Settings::default() };
        Arc::new(Config { settings, ..Config::default() })
    }

    fn draw(positions: [[f32; 3]; 3]) -> Draw {
        let mut attributes = Attributes::constant(&CurrentAttributes::default());
        attributes.normals = Values::PerVertex(vec![[0.0, f32::NAN, 1.0]; 3]);
        Draw {
            geometry: GeometryCache::default().of_indices(&positions, &[[0, 1, 2]]),
            attributes: Arc::new(attributes),
            state: Arc::default(),
            shading: Shading::Fixed,
            clip_from_object: [0.5; 16],
            calls: 1,
            ray_material: RayMaterial::default(),
        }
    }

    fn layer() -> Layer {
        let rect = Rect { x: 0, y: 0, w: 1, h: 1 };
        Layer { rect, color: vec![[9; 4]], depth: vec![0.5], covered: 1 }
    }

    #[test]
    fn a_picture_is_shown_again_only_while_nothing_has_changed() {
        let positions = [[0.0; 3], [1.0, 0.0, f32::NAN], [0.0, 1.0, 0.0]];
        let config = config(Mode::Match);
        let mut again = FrameReuse::default();
        let first = [(draw(positions), None)];
        assert!(again.find(&first, &config).is_none());
        again.keep(DrawKey::of(&first, &config.settings), &config, layer());
        let mut same = |d: Draw| {
            let found = again.find(&[(d, None)], &config);
            let is = found.is_some();
            found.into_iter().for_each(|l| again.put_back(l));
            is
        };
        assert!(same(draw(positions)), "made anew, and the same bit by bit");
        fn bit(v: f32) -> f32 {
            f32::from_bits(v.to_bits() ^ 1)
        }
        let changes: [fn(&mut Draw); 8] = [
            |d| d.clip_from_object[7] = bit(0.5),
            |d| {
                let mut normals = vec![[0.0, f32::NAN, 1.0]; 3];
                normals[2][1] = bit(f32::NAN);
                Arc::make_mut(&mut d.attributes).normals = Values::PerVertex(normals);
            },
            |d| Arc::make_mut(&mut d.attributes).colors = Values::Constant([0.25; 4]),
            |d| Arc::make_mut(&mut d.attributes).materials[0][1].shininess = 1.0,
            |d| Arc::make_mut(&mut d.attributes).version = 1,
            |d| Arc::make_mut(&mut d.attributes).tex = Values::Constant([0.25; 4]),
            |d| Arc::make_mut(&mut d.state).lighting = true,
            |d| {
                let moved = [[0.0; 3], [1.0, 0.0, bit(f32::NAN)], [0.0, 1.0, 0.0]];
                d.geometry = GeometryCache::default().of_indices(&moved, &[[0, 1, 2]]);
            },
        ];
        for (i, change) in changes.into_iter().enumerate() {
            let mut d = draw(positions);
            change(&mut d);
            // A version is compared with a version: here there is none, and the content is the
            // same. Nor is there a texture.
            assert_eq!(same(d), matches!(i, 4 | 5), "change {i}");
        }
        assert!(same(draw(positions)), "back to what it was");
        let other = super::tests::config(Mode::Match);
        assert!(again.find(&first, &other).is_none(), "other settings");
        assert!(DrawKey::of(&first, &super::tests::config(Mode::Phong).settings).is_none());
        again.frame_done();
        again.frame_done();
        assert!(again.find(&first, &config).is_none(), "the frame after is over");
    }

    #[test]
    fn draws_in_order_come_again_in_another_colour_only_where_that_is_all_there_is_to_them() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let config = config(Mode::Match);
        let colored = |color: [f32; 4], lit: bool| {
            let mut d = draw(positions);
            Arc::make_mut(&mut d.attributes).colors = Values::Constant(color);
            Arc::make_mut(&mut d.state).lighting = lit;
            d
        };
        let layers = |color| {
            vec![Layer { color: vec![color, [0; 4]], depth: vec![0.5, UNCOVERED], ..layer() }]
        };
        let [red, green] = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]];
        for lit in [false, true] {
            let mut again = FrameReuse::default();
            assert!(again.find_ordered(&colored(red, lit), None, &config).is_none());
            again.keep_ordered(&colored(red, lit), None, &config, layers([255, 0, 0, 255]));
            let found = again.find_ordered(&colored(green, lit), None, &config);
            assert_eq!(found.is_some(), !lit);
            let Some(found) = found else { continue };
            assert_eq!((found[0].color[0], found[0].depth[1]), ([0, 255, 0, 255], UNCOVERED));
            again.keep_ordered(&colored(green, lit), None, &config, found);
            let mut moved = colored(green, lit);
            moved.clip_from_object[3] = 0.25;
            assert!(again.find_ordered(&moved, None, &config).is_none(), "another place");
            again.frame_done();
            again.frame_done();
            assert!(
                again.find_ordered(&colored(green, lit), None, &config).is_none(),
                "the frame after is over"
            );
        }
        // Fragments of more than the one colour are not what this is about.
        let mut again = FrameReuse::default();
        again.keep_ordered(&colored(red, false), None, &config, layers([9, 9, 9, 9]));
        assert!(again.find_ordered(&colored(green, false), None, &config).is_none());
        assert!(again.find_ordered(&colored(red, false), None, &config).is_some());
    }
}

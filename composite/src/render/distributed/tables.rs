//! The table in which a rank tells the others what it has: a row for each object and volume, and
//! nothing of their primitives and values.
use super::rank_scene::{DistributedVolume, Object, RankScene};
use super::words::{Reader, Writer};
use rt_core::bvh::Geometry;
use rt_core::glam::{DAffine3, DVec3, UVec3};
use rt_core::mesh::TriMesh;
use rt_core::scene::Scene;
use std::collections::HashSet;

/// Longest name of an object or a volume, bytes.
pub(super) const LONGEST_NAME: usize = 200;
/// Most instances of an object.
const MOST_PLACES: usize = 1 << 24;

/// What one rank has of an object.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ObjectRow {
    pub(super) name: String,
    pub(super) is_mesh: bool,
    pub(super) material: u32,
    /// Bits of [`ATTRIBUTES`].
    pub(super) attributes: u32,
    /// Whether its colours are transparent somewhere.
    pub(super) transparent: bool,
    pub(super) origin: DVec3,
    pub(super) primitives: u64,
    pub(super) places: u32,
    pub(super) places_digest: u64,
}

/// Attributes of meshes, by bit.
pub(super) const ATTRIBUTES: [&str; 5] =
    ["normals", "colors", "scalars", "texture coordinates", "tangents"];

/// What one rank has of a volume: first point and points per axis of each brick.
pub(super) type BrickRow = Vec<[UVec3; 2]>;

/// What one rank has.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Table {
    pub(super) objects: Vec<ObjectRow>,
    /// By volume.
    pub(super) bricks: Vec<BrickRow>,
}

fn attributes_of(mesh: &TriMesh) -> u32 {
    let there = [
        mesh.normals.is_some(),
        mesh.colors.is_some(),
        mesh.scalars.is_some(),
        mesh.texcoords.is_some(),
        mesh.tangents.is_some(),
    ];
    there.iter().enumerate().fold(0, |bits, (k, &on)| bits | u32::from(on) << k)
}

/// A digest of transforms, to the last bit.
pub(super) fn digest_of_places(places: &[DAffine3]) -> u64 {
    let numbers = places.iter().flat_map(|p| p.to_cols_array());
    numbers.fold(places.len() as u64, |state, n| crate::codec::mix(state, n.to_bits()))
}

impl ObjectRow {
    fn new(object: &Object) -> ObjectRow {
        let (is_mesh, attributes, origin, transparent) = match &object.geometry {
            Geometry::Mesh(mesh) => {
                let alpha = |c: &[f32; 4]| c[3] < 1.0;
                let transparent = mesh.colors.as_ref().is_some_and(|c| c.values.iter().any(alpha));
                (true, attributes_of(mesh), mesh.origin, transparent)
            }
            Geometry::Shape(shape) => (false, 0, shape.origin(), shape.has_transparency()),
            Geometry::Slices(_) => (true, 0, DVec3::ZERO, false),
        };
        ObjectRow {
            name: object.name.clone(),
            is_mesh,
            material: object.material as u32,
            attributes,
            transparent,
            origin,
            primitives: object.geometry.num_primitives() as u64,
            places: object.places.len() as u32,
            places_digest: digest_of_places(&object.places),
        }
    }
}

impl Table {
    /// The table of a scene that [`check`] accepts.
    pub(super) fn of(scene: &RankScene) -> Table {
        let pieces = scene.objects.iter().filter(|o| o.geometry.num_primitives() > 0);
        let row = |v: &DistributedVolume| v.bricks.iter().map(|b| [b.first, b.dims]).collect();
        let bricks = scene.volumes.iter().map(row);
        Table { objects: pieces.map(ObjectRow::new).collect(), bricks: bricks.collect() }
    }

    pub(super) fn encode(&self) -> Vec<u32> {
        let mut out = Writer::default();
        out.u32(self.objects.len() as u32);
        for row in &self.objects {
            out.text(&row.name);
            out.u32(u32::from(row.is_mesh) | u32::from(row.transparent) << 1);
            out.u32(row.material);
            out.u32(row.attributes);
            out.f64s(&row.origin.to_array());
            out.u64(row.primitives);
            out.u32(row.places);
            out.u64(row.places_digest);
        }
        out.u32(self.bricks.len() as u32);
        for row in &self.bricks {
            out.u32(row.len() as u32);
            row.iter().flatten().for_each(|corner| out.uvec3(*corner));
        }
        out.0
    }

    /// Reads the table of another rank, for a scene with `materials` materials and volumes whose
    /// grids have `dims` points.
    ///
    /// # Errors
    /// What cannot be, in words.
    pub(super) fn decode(words: &[u32], materials: usize, dims: &[UVec3]) -> Result<Table, String> {
        let table = Table::read(words).ok_or("its table ends early or has unknown flags")?;
        let mut names = HashSet::new();
        for row in &table.objects {
            let name = &row.name;
            let fault = |what: &str| Err(format!("object `{name}`: {what}"));
            if name.is_empty() || !names.insert(name) {
                return fault("its name is empty, or there twice");
            }
            if row.material as usize >= materials {
                return fault(&format!("material {} of {materials}", row.material));
            }
            if !row.origin.is_finite() {
                return fault(&format!("the origin is {}", row.origin));
            }
            if row.primitives == 0 || row.primitives >= u64::from(u32::MAX) {
                return fault(&format!("{} primitives", row.primitives));
            }
            if row.places == 0 || row.places as usize > MOST_PLACES {
                return fault(&format!("{} places", row.places));
            }
        }
        if table.bricks.len() != dims.len() {
            return Err(format!("bricks of {} volumes of {}", table.bricks.len(), dims.len()));
        }
        for (v, (row, dims)) in table.bricks.iter().zip(dims).enumerate() {
            let outside = |[first, size]: &&[UVec3; 2]| !is_inside(*first, *size, *dims);
            if let Some([first, size]) = row.iter().find(outside) {
                return Err(format!(
                    "a brick of {size} points at {first} of volume {v}, which has {dims}"
                ));
            }
        }
        Ok(table)
    }

    fn read(words: &[u32]) -> Option<Table> {
        let mut reader = Reader(words);
        let objects = reader.count(16)?;
        let object = |_| {
            let name = reader.text(LONGEST_NAME)?;
            let flags = reader.u32().filter(|flags| *flags < 4)?;
            Some(ObjectRow {
                name,
                is_mesh: flags & 1 != 0,
                transparent: flags & 2 != 0,
                material: reader.u32()?,
                attributes: reader.u32().filter(|bits| *bits < 1 << ATTRIBUTES.len())?,
                origin: reader.dvec3()?,
                primitives: reader.u64()?,
                places: reader.u32()?,
                places_digest: reader.u64()?,
            })
        };
        let objects = (0..objects).map(object).collect::<Option<Vec<_>>>()?;
        let volumes = reader.count(1)?;
        let row = |_| {
            let bricks = reader.count(6)?;
            let brick = |_| Some([reader.uvec3()?, reader.uvec3()?]);
            (0..bricks).map(brick).collect::<Option<Vec<_>>>()
        };
        let bricks = (0..volumes).map(row).collect::<Option<Vec<_>>>()?;
        reader.is_at_end().then_some(Table { objects, bricks })
    }
}

/// Whether a brick has points, and all of them are in a grid of `dims` points.
fn is_inside(first: UVec3, size: UVec3, dims: UVec3) -> bool {
    size.min_element() > 0 && size.cmple(dims).all() && first.cmple(dims - size).all()
}

/// Checks what this rank gives.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn check(scene: &RankScene) -> Result<(), String> {
    let name_fault = |name: &str| {
        (name.is_empty() || name.len() > LONGEST_NAME)
            .then(|| format!("a name of {} bytes; give it 1 to {LONGEST_NAME}", name.len()))
    };
    let mut names = HashSet::new();
    for object in &scene.objects {
        let name = &object.name;
        let fault = |what: String| Err(format!("object `{name}`: {what}"));
        if let Some(what) = name_fault(name) {
            return fault(what);
        }
        if !names.insert(name) {
            return fault("it is there twice; give all of its primitives as one piece".into());
        }
        if object.material >= scene.materials.len() {
            let count = scene.materials.len();
            return fault(format!("it has material {}, but there are {count}", object.material));
        }
        match &object.geometry {
            Geometry::Mesh(mesh) => {
                if let Err(error) = mesh.check() {
                    return fault(error.to_string());
                }
                if !mesh.origin.is_finite() {
                    return fault(format!("its origin is {}; make it finite", mesh.origin));
                }
            }
            Geometry::Shape(shape) if !shape.origin().is_finite() => {
                return fault(format!("its origin is {}; make it finite", shape.origin()));
            }
            Geometry::Shape(_) => {}
            Geometry::Slices(_) => return fault("it has no arrays to shade".into()),
        }
        if object.places.is_empty() || object.places.len() > MOST_PLACES {
            let count = object.places.len();
            return fault(format!("{count} places; give it 1 to {MOST_PLACES}"));
        }
        let singular = |p: &DAffine3| {
            let determinant = p.matrix3.determinant();
            !(p.is_finite() && determinant.is_finite() && determinant != 0.0)
        };
        if let Some(k) = object.places.iter().position(singular) {
            return fault(format!(
                "its place {k} cannot be inverted; give one that is finite and not singular"
            ));
        }
    }
    let mut names = HashSet::new();
    for volume in &scene.volumes {
        let name = &volume.name;
        let fault = |what: String| Err(format!("volume `{name}`: {what}"));
        if let Some(what) = name_fault(name) {
            return fault(what);
        }
        if !names.insert(name) {
            return fault("it is there twice; give all its bricks at once".into());
        }
        let whole = volume.whole;
        if whole.dims.min_element() < 2 {
            return fault(format!("its grid has {} points; it needs 2 on each axis", whole.dims));
        }
        if !(whole.spacing.cmpgt(DVec3::ZERO).all() && whole.spacing.is_finite()) {
            return fault(format!("its spacing is {}; make it positive", whole.spacing));
        }
        if !whole.origin.is_finite() {
            return fault(format!("its origin is {}; make it finite", whole.origin));
        }
        for brick in &volume.bricks {
            if !is_inside(brick.first, brick.dims, whole.dims) {
                return fault(format!(
                    "a brick has {} points at {}, outside of the grid of {}",
                    brick.dims, brick.first, whole.dims
                ));
            }
            let points = brick.dims.as_u64vec3().element_product();
            if brick.values.len() as u64 != points {
                let found = brick.values.len();
                return fault(format!("a brick has {found} values for {points} points"));
            }
        }
    }
    Ok(())
}

/// Checks the assembled scene.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn check_scene(scene: &Scene) -> Result<(), String> {
    scene.check().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn row(name: &str) -> ObjectRow {
        ObjectRow {
            name: name.into(),
            is_mesh: true,
            material: 1,
            attributes: 5,
            transparent: true,
            origin: DVec3::new(1.0, -2.0, 4e6),
            primitives: 1 << 30,
            places: 1,
            places_digest: 77,
        }
    }

    fn table() -> Table {
        Table {
            objects: vec![row("wing"), row("Größe")],
            bricks: vec![vec![], vec![[UVec3::new(3, 0, 1), UVec3::new(4, 9, 2)]]],
        }
    }

    const DIMS: [UVec3; 2] = [UVec3::splat(5), UVec3::new(7, 9, 3)];

    #[test]
    fn tables_survive_and_cut_ones_are_refused() {
        let words = table().encode();
        assert_eq!(Table::decode(&words, 2, &DIMS), Ok(table()));
        for end in 0..words.len() {
            assert!(Table::decode(&words[..end], 2, &DIMS).is_err(), "{end} words");
        }
    }

    #[test]
    fn what_cannot_be_is_refused_by_the_name_of_the_object() {
        let with = |change: fn(&mut Table)| {
            let mut table = table();
            change(&mut table);
            Table::decode(&table.encode(), 2, &DIMS).expect_err("it cannot be")
        };
        for (words, change) in [
            ("material 2 of 2", (|t| t.objects[0].material = 2) as fn(&mut Table)),
            ("the origin is", |t| t.objects[0].origin.y = f64::NAN),
            ("0 primitives", |t| t.objects[0].primitives = 0),
            ("18446744073709551615 primitives", |t| t.objects[0].primitives = u64::MAX),
            ("0 places", |t| t.objects[0].places = 0),
            ("4294967295 places", |t| t.objects[0].places = u32::MAX),
        ] {
            let error = with(change);
            assert!(error.contains("`wing`") && error.contains(words), "{error}");
        }
        assert!(with(|t| t.objects[1].name = "wing".into()).contains("there twice"));
        assert!(with(|t| t.bricks[1] = vec![[UVec3::MAX, UVec3::ONE]]).contains("volume 1"));
        assert!(with(|t| t.bricks[1] = vec![[UVec3::ONE, UVec3::ZERO]]).contains("volume 1"));
        assert!(with(|t| t.bricks.truncate(1)).contains("bricks of 1 volumes of 2"));
    }

    proptest! {
        #[test]
        fn any_words_are_read_without_a_panic(
            words in proptest::collection::vec(any::<u32>(), 0..60),
            at in 0usize..60, word in any::<u32>(),
        ) {
            let _ = Table::decode(&words, 2, &DIMS);
            let mut changed = table().encode();
            let at = at % changed.len();
            changed[at] = word;
            let _ = Table::decode(&changed, 2, &DIMS);
        }
    }
}

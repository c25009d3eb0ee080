//! The objects of all ranks, merged into one list.
use super::agreement::contradiction_among;
use super::tables::{ATTRIBUTES, ObjectRow, Table, digest_of_places};
use super::words::{Reader, Writer};
use crate::render::FrameError;
use crate::render::request_reply::RankChannel;
use rt_core::bvh::Geometry;
use rt_core::glam::DAffine3;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::shapes::{Radii, Spheres};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Words of a transform.
const PLACE_WORDS: usize = 24;

/// An object of the sum of all parts.
pub(super) struct MergedObject {
    /// What all its pieces have in common, the numbers of primitives and the transparency of all
    /// pieces together.
    pub(super) row: ObjectRow,
    /// The lowest rank that has a piece.
    pub(super) first_rank: usize,
    /// Number of this rank's first primitive in the whole object.
    pub(super) first_primitive: u32,
    pub(super) places: Vec<DAffine3>,
}

/// One list of objects from the tables of all ranks, in the order of their names.
///
/// # Errors
/// [`FrameError::Contradiction`], and [`FrameError::RankScene`] for an object with too many
/// primitives; the same on every rank.
pub(super) fn merge(tables: &[Table], rank: usize) -> Result<Vec<MergedObject>, FrameError> {
    let mut pieces: BTreeMap<&str, Vec<(usize, &ObjectRow)>> = BTreeMap::new();
    for (from, table) in tables.iter().enumerate() {
        for row in &table.objects {
            pieces.entry(&row.name).or_default().push((from, row));
        }
    }
    let mut merged = Vec::with_capacity(pieces.len());
    for (name, pieces) in pieces {
        compare(name, &pieces)?;
        let (first_rank, first) = pieces[0];
        let mut row = first.clone();
        (row.primitives, row.transparent) = (0, false);
        let mut first_primitive = 0;
        for (from, piece) in &pieces {
            if *from == rank {
                first_primitive = row.primitives as u32;
            }
            row.primitives = row.primitives.saturating_add(piece.primitives);
            row.transparent |= piece.transparent;
            if row.primitives >= u64::from(u32::MAX) {
                let reason = format!(
                    "object `{name}` has more than {} primitives with its piece of this rank; give \
                     its pieces several names",
                    u32::MAX - 1
                );
                return Err(FrameError::RankScene { rank: *from, reason });
            }
        }
        let places = vec![DAffine3::IDENTITY];
        merged.push(MergedObject { row, first_rank, first_primitive, places });
    }
    Ok(merged)
}

/// Looks for the first field in which pieces of an object differ.
fn compare(name: &str, pieces: &[(usize, &ObjectRow)]) -> Result<(), FrameError> {
    let what = format!("object `{name}`");
    let check = |field: &str, of: &dyn Fn(&ObjectRow) -> (u64, String)| {
        let values = || pieces.iter().map(|(rank, row)| (*rank, of(row)));
        let first = values().next().map(|(_, (key, _))| key);
        if values().all(|(_, (key, _))| Some(key) == first) {
            return Ok(());
        }
        let values = values().map(|(rank, (key, text))| (rank, key, text));
        Err(contradiction_among(&what, field, values))
    };
    check("kind", &|row| {
        (row.is_mesh.into(), if row.is_mesh { "a mesh" } else { "a shape" }.into())
    })?;
    check("material", &|row| (row.material.into(), row.material.to_string()))?;
    for axis in 0..3 {
        let field = ["origin.x", "origin.y", "origin.z"][axis];
        check(field, &|row| (row.origin[axis].to_bits(), row.origin[axis].to_string()))?;
    }
    for (bit, field) in ATTRIBUTES.iter().enumerate() {
        check(field, &|row| {
            let there = row.attributes >> bit & 1;
            (there.into(), if there == 1 { "given" } else { "missing" }.into())
        })?;
    }
    check("places", &|row| (row.places_digest, format!("a list of {}", row.places)))?;
    check("places", &|row| (row.places.into(), format!("a list of {}", row.places)))
}

/// Sends the places of the objects that have others than one without a transform: each list once,
/// from the lowest rank that has it. `own` are the lists of this rank's pieces, by object.
pub(super) fn exchange_places(
    channel: &mut RankChannel<'_>,
    objects: &mut [MergedObject],
    own: &[Option<&[DAffine3]>],
) -> Result<(), FrameError> {
    let plain = digest_of_places(&[DAffine3::IDENTITY]);
    let listed: Vec<usize> = (0..objects.len())
        .filter(|&k| objects[k].row.places != 1 || objects[k].row.places_digest != plain)
        .collect();
    if listed.is_empty() {
        return Ok(());
    }
    let rank = channel.rank();
    let mut mine = Writer::default();
    for &k in listed.iter().filter(|&&k| objects[k].first_rank == rank) {
        let places = own[k].unwrap_or_default();
        places.iter().for_each(|place| mine.f64s(&place.to_cols_array()));
    }
    let all = channel.all_gather_varying(&mine.0)?;
    let mut readers: Vec<Reader<'_>> = all.iter().map(|words| Reader(words)).collect();
    for &k in &listed {
        let (from, count) = (objects[k].first_rank, objects[k].row.places as usize);
        let places = read_places(&mut readers[from], count);
        objects[k].places = places
            .filter(|places| digest_of_places(places) == objects[k].row.places_digest)
            .ok_or_else(|| channel.message_error(from, "places of objects", all[from].len()))?;
    }
    match readers.iter().position(|reader| !reader.is_at_end()) {
        Some(from) => Err(channel.message_error(from, "places of objects", all[from].len())),
        None => Ok(()),
    }
}

fn read_places(reader: &mut Reader<'_>, count: usize) -> Option<Vec<DAffine3>> {
    if count.checked_mul(PLACE_WORDS)? > reader.0.len() {
        return None;
    }
    let place = |_| {
        let [x, y, z, t] = [reader.dvec3()?, reader.dvec3()?, reader.dvec3()?, reader.dvec3()?];
        Some(DAffine3::from_cols(x, y, z, t))
    };
    (0..count).map(place).collect()
}

/// What stands for an object on a rank that has no piece of it.
///
/// # Errors
/// None that a table which was checked can cause, in words.
pub(super) fn nothing_of(row: &ObjectRow) -> Result<Geometry, String> {
    if !row.is_mesh {
        let none = Spheres::new(Vec::new(), Radii::Common(1.0)).map_err(|e| e.to_string())?;
        return Ok(Geometry::Shape(Arc::new(none.with_origin(row.origin))));
    }
    fn empty<T>() -> Attribute<T> {
        Attribute::per_vertex(Vec::new())
    }
    let has = |bit: u32| row.attributes >> bit & 1 != 0;
    Ok(Geometry::Mesh(Arc::new(TriMesh {
        origin: row.origin,
        normals: has(0).then(empty),
        colors: has(1).then(empty),
        scalars: has(2).then(empty),
        texcoords: has(3).then(Vec::new),
        tangents: has(4).then(Vec::new),
        ..TriMesh::default()
    })))
}

/// Checks that the world has room for the instances of all objects.
pub(super) fn num_instances(objects: &[MergedObject]) -> Option<u32> {
    objects.iter().try_fold(0u32, |sum, o| sum.checked_add(o.row.places))
}

//! The attributes of a page's triangles: normals, colours and scalars, of vertices or of triangles.
//!
//! They lie behind the page, and are read when a hit on it is shaded: pages that only shadows or
//! occlusion rays meet stay without. Equal values are stored once.
//!
//! ```text
//! word 0   triangles; word 1: four bytes: what vertices have, what triangles have (bit 0 normals,
//!          1 colours, 2 scalars), bits of a coordinate of the normals of each (0: three f32)
//!      2   different values of vertices, of triangles
//!      4   smallest and largest number of a triangle
//!      6   bits: the triangles' numbers, in ascending order, from the smallest on; for each, the
//!          numbers of its three corners' values; and that of its own
//!          values of vertices, then those of triangles: normals, colours (four f32), scalars (f32)
//! ```

use super::octahedral;
use crate::bvh::compact::bits;
use crate::mesh::{Attribute, PerElement};
use glam::Vec3;
use std::collections::HashMap;

const HEADER_WORDS: usize = 6;
/// Triangles of which one's number is kept unpacked, for the search.
const STRIDE: u32 = 16;
/// More triangles than any page has: numbers of bits stay small.
const MOST_TRIANGLES: u32 = 1 << 20;
const NORMALS: u32 = 1;
const COLORS: u32 = 2;
const SCALARS: u32 = 4;

/// Attributes of a mesh or a piece of one.
#[derive(Clone, Copy, Default)]
pub(super) struct MeshAttributes<'a> {
    pub(super) normals: Option<&'a Attribute<Vec3>>,
    pub(super) colors: Option<&'a Attribute<[f32; 4]>>,
    pub(super) scalars: Option<&'a Attribute<f32>>,
}

impl MeshAttributes<'_> {
    pub(super) fn any(&self) -> bool {
        self.normals.is_some() || self.colors.is_some() || self.scalars.is_some()
    }
}

/// What one vertex or one triangle has.
#[derive(Clone, Copy, Default)]
struct Values {
    normal: Vec3,
    color: [f32; 4],
    scalar: f32,
}

/// What a hit has.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct HitAttributes {
    pub(crate) normal: Option<Vec3>,
    pub(crate) color: Option<[f32; 4]>,
    pub(crate) scalar: Option<f32>,
}

/// Values of vertices, or of triangles, on their way into a page.
#[derive(Default)]
struct ValueTable {
    fields: u32,
    normal_bits: u32,
    numbers: HashMap<[u32; 8], u32>,
    values: Vec<[u32; 8]>,
}

impl ValueTable {
    /// A table of what `all` have.
    fn new(fields: u32, all: &[Values], tolerance: f64) -> ValueTable {
        let normals: Vec<Vec3> = if fields & NORMALS != 0 && tolerance > 0.0 {
            all.iter().map(|v| v.normal).collect()
        } else {
            Vec::new()
        };
        let normal_bits =
            if normals.is_empty() { None } else { octahedral::bits_for(&normals, tolerance) };
        ValueTable { fields, normal_bits: normal_bits.unwrap_or(0), ..ValueTable::default() }
    }

    /// The number of a value. Different bits are different values.
    fn number(&mut self, v: &Values) -> u32 {
        let mut key = [0; 8];
        if self.fields & NORMALS != 0 {
            if self.normal_bits > 0 {
                key[..2].copy_from_slice(&octahedral::encode(v.normal, self.normal_bits));
            } else {
                key[..3].copy_from_slice(&v.normal.to_array().map(f32::to_bits));
            }
        }
        if self.fields & COLORS != 0 {
            key[3..7].copy_from_slice(&v.color.map(f32::to_bits));
        }
        if self.fields & SCALARS != 0 {
            key[7] = v.scalar.to_bits();
        }
        *self.numbers.entry(key).or_insert_with(|| {
            self.values.push(key);
            self.values.len() as u32 - 1
        })
    }

    fn write(&self, words: &mut Vec<u32>) {
        if self.fields & NORMALS != 0 {
            if self.normal_bits > 0 {
                let mut writer = bits::Writer::new(words);
                for [x, y, ..] in &self.values {
                    writer.push(*x, self.normal_bits);
                    writer.push(*y, self.normal_bits);
                }
                writer.finish();
            } else {
                self.values.iter().for_each(|v| words.extend(&v[..3]));
            }
        }
        if self.fields & COLORS != 0 {
            self.values.iter().for_each(|v| words.extend(&v[3..7]));
        }
        if self.fields & SCALARS != 0 {
            words.extend(self.values.iter().map(|v| v[7]));
        }
    }
}

/// The attributes of the triangles `ids` of a mesh with these corners, in a page's form. Normals
/// are off by at most `tolerance` degrees; as given with a tolerance of 0.
pub(super) fn encode(
    mut ids: Vec<u32>,
    corners: impl Fn(u32) -> [u32; 3],
    mesh: &MeshAttributes<'_>,
    tolerance: f64,
) -> Vec<u32> {
    ids.sort_unstable();
    let fields = |per: PerElement| {
        let bit = |p: Option<PerElement>, bit: u32| if p == Some(per) { bit } else { 0 };
        bit(mesh.normals.map(|a| a.per), NORMALS)
            | bit(mesh.colors.map(|a| a.per), COLORS)
            | bit(mesh.scalars.map(|a| a.per), SCALARS)
    };
    let values = |fields: u32, i: u32| Values {
        normal: value(mesh.normals, fields & NORMALS, i),
        color: value(mesh.colors, fields & COLORS, i),
        scalar: value(mesh.scalars, fields & SCALARS, i),
    };
    let of = [fields(PerElement::Vertex), fields(PerElement::Face)];
    let all: [Vec<Values>; 2] = [
        ids.iter().flat_map(|&i| corners(i)).map(|vertex| values(of[0], vertex)).collect(),
        ids.iter().map(|&i| values(of[1], i)).collect(),
    ];
    let mut tables = [0, 1].map(|k| ValueTable::new(of[k], &all[k], tolerance));
    let numbers = [0, 1].map(|k| {
        let table: &mut ValueTable = &mut tables[k];
        all[k].iter().map(|v| table.number(v)).collect::<Vec<u32>>()
    });
    let [vertices, faces] = &tables;
    let (first, last) = (ids.first().copied().unwrap_or(0), ids.last().copied().unwrap_or(0));
    let kinds =
        vertices.fields | faces.fields << 8 | vertices.normal_bits << 16 | faces.normal_bits << 24;
    let counts = [vertices, faces].map(|t| t.values.len() as u32);
    let mut words = vec![ids.len() as u32, kinds, counts[0], counts[1], first, last];
    let mut writer = bits::Writer::new(&mut words);
    let width = bits::width(last - first);
    ids.iter().for_each(|&i| writer.push(i - first, width));
    for (numbers, count) in numbers.iter().zip(counts) {
        let width = bits::width(count.saturating_sub(1));
        numbers.iter().for_each(|&i| writer.push(i, width));
    }
    writer.finish();
    vertices.write(&mut words);
    faces.write(&mut words);
    words
}

/// Value `i` of an attribute where it is asked for. The corners of triangles that can be hit exist,
/// and attributes have as many values as the mesh's check found.
fn value<T: Copy + Default>(attribute: Option<&Attribute<T>>, wanted: u32, i: u32) -> T {
    let found = attribute.filter(|_| wanted != 0).and_then(|a| a.values.get(i as usize));
    found.copied().unwrap_or_default()
}

/// Where the values of vertices, or of triangles, are.
struct ValuePlaces {
    fields: u32,
    normal_bits: u32,
    count: u32,
    /// Bits of a number of a value, and the bit where the first starts.
    width: u32,
    numbers: usize,
    /// First words.
    normals: usize,
    colors: usize,
    scalars: usize,
}

/// The attributes of a page in memory.
pub(super) struct PageAttributes {
    words: Vec<u32>,
    triangles: u32,
    first: u32,
    id_width: u32,
    /// The numbers of triangles 0, [`STRIDE`] and so on of the page.
    some_ids: Vec<u32>,
    vertices: ValuePlaces,
    faces: ValuePlaces,
}

impl PageAttributes {
    /// The error says what is wrong with the words.
    pub(super) fn of_words(words: Vec<u32>) -> Result<PageAttributes, &'static str> {
        let Some(&[triangles, kinds, of_vertices, of_faces, first, last]) = words.first_chunk()
        else {
            return Err("the attributes end in their first words");
        };
        let [vertex_fields, face_fields, vertex_bits, face_bits] = kinds.to_le_bytes();
        let id_width = bits::width(last.checked_sub(first).ok_or("no range of triangles")?);
        if triangles > MOST_TRIANGLES || of_vertices.max(of_faces) > 3 * triangles {
            return Err("they belong to more triangles than a page has");
        }
        let n = triangles as usize;
        let mut at = 32 * HEADER_WORDS + n * id_width as usize;
        let mut places = [
            (3 * n, vertex_fields, vertex_bits, of_vertices),
            (n, face_fields, face_bits, of_faces),
        ]
        .map(|(numbers, fields, normal_bits, count)| {
            let width = bits::width(count.saturating_sub(1));
            let start = at;
            at += numbers * width as usize;
            ValuePlaces {
                fields: fields.into(),
                normal_bits: normal_bits.into(),
                count,
                width,
                numbers: start,
                normals: 0,
                colors: 0,
                scalars: 0,
            }
        });
        // As `bits::Writer::finish` ends.
        let mut word = at / 32 + 2;
        for p in &mut places {
            let count = p.count as usize;
            if p.fields > 7 || p.normal_bits > *octahedral::BITS.end() {
                return Err("they are of no kind that is known");
            }
            p.normals = word;
            if p.fields & NORMALS != 0 {
                let packed = 2 * count * p.normal_bits as usize / 32 + 2;
                word += if p.normal_bits > 0 { packed } else { 3 * count };
            }
            p.colors = word;
            word += if p.fields & COLORS != 0 { 4 * count } else { 0 };
            p.scalars = word;
            word += if p.fields & SCALARS != 0 { count } else { 0 };
        }
        if word != words.len() {
            return Err("the attributes do not end where the page does");
        }
        let [vertices, faces] = places;
        let some_ids = Vec::new();
        let mut found =
            PageAttributes { words, triangles, first, id_width, some_ids, vertices, faces };
        let exist = |p: &ValuePlaces, numbers: u32| {
            p.fields == 0 || (0..numbers).all(|i| found.number(p, i) < p.count)
        };
        let ascending = (1..triangles).all(|k| found.id(k - 1) < found.id(k));
        if !exist(&found.vertices, 3 * triangles) || !exist(&found.faces, triangles) || !ascending {
            return Err("a value that is asked for does not exist");
        }
        found.some_ids = (0..triangles).step_by(STRIDE as usize).map(|k| found.id(k)).collect();
        Ok(found)
    }

    /// Bytes in memory.
    pub(super) fn bytes(&self) -> usize {
        4 * (self.words.len() + self.some_ids.len()) + size_of::<PageAttributes>()
    }

    /// The number of the triangle in the piece that is `k`th of the page, from the first on.
    fn id(&self, k: u32) -> u32 {
        let at = 32 * HEADER_WORDS + (k * self.id_width) as usize;
        bits::read(&self.words, at, self.id_width)
    }

    /// Which of the page's triangles, in ascending order, has this number.
    fn place_of(&self, id: u32) -> Option<u32> {
        let stretch = self.some_ids.partition_point(|&first| first <= id).checked_sub(1)?;
        let mut low = stretch as u32 * STRIDE;
        let mut high = (low + STRIDE).min(self.triangles);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.id(middle) < id { low = middle + 1 } else { high = middle }
        }
        (low < self.triangles && self.id(low) == id).then_some(low)
    }

    fn number(&self, p: &ValuePlaces, i: u32) -> u32 {
        bits::read(&self.words, p.numbers + (i * p.width) as usize, p.width)
    }

    /// What the point with the weights `w`, `u`, `v` of triangle `id` has, from the same operations
    /// as on a mesh in memory. Nothing for triangles of other pages.
    pub(super) fn at(&self, id: u32, [w, u, v]: [f32; 3]) -> HitAttributes {
        let mut found = HitAttributes::default();
        let Some(id) = id.checked_sub(self.first) else { return found };
        let Some(k) = self.place_of(id) else { return found };
        let p = &self.faces;
        if p.fields != 0 {
            let i = self.number(p, k);
            found.normal = (p.fields & NORMALS != 0).then(|| self.normal(p, i));
            found.color = (p.fields & COLORS != 0).then(|| self.color(p, i));
            found.scalar = (p.fields & SCALARS != 0).then(|| self.scalar(p, i));
        }
        let p = &self.vertices;
        if p.fields != 0 {
            let corners = [3 * k, 3 * k + 1, 3 * k + 2].map(|i| self.number(p, i));
            if p.fields & NORMALS != 0 {
                let [x, y, z] = corners.map(|i| self.normal(p, i));
                found.normal = Some(x * w + y * u + z * v);
            }
            if p.fields & COLORS != 0 {
                let [x, y, z] = corners.map(|i| self.color(p, i));
                found.color = Some(std::array::from_fn(|c| x[c] * w + y[c] * u + z[c] * v));
            }
            if p.fields & SCALARS != 0 {
                let [x, y, z] = corners.map(|i| self.scalar(p, i));
                found.scalar = Some(x * w + y * u + z * v);
            }
        }
        found
    }

    fn normal(&self, p: &ValuePlaces, i: u32) -> Vec3 {
        if p.normal_bits == 0 {
            let at = p.normals + 3 * i as usize;
            return Vec3::from_array([0, 1, 2].map(|k| f32::from_bits(self.words[at + k])));
        }
        let at = 32 * p.normals + (2 * i * p.normal_bits) as usize;
        let q = [0, p.normal_bits as usize]
            .map(|more| bits::read(&self.words, at + more, p.normal_bits));
        octahedral::decode(q, p.normal_bits)
    }

    fn color(&self, p: &ValuePlaces, i: u32) -> [f32; 4] {
        let at = p.colors + 4 * i as usize;
        [0, 1, 2, 3].map(|k| f32::from_bits(self.words[at + k]))
    }

    fn scalar(&self, p: &ValuePlaces, i: u32) -> f32 {
        f32::from_bits(self.words[p.scalars + i as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;

    #[test]
    fn damaged_words_are_refused_or_answer_and_never_panic() {
        let mut r = Random::new(3);
        let normals = Attribute::per_vertex((0..300).map(|_| r.direction()).collect());
        let scalars = Attribute::per_face((0..200).map(|i| i as f32).collect());
        let mesh =
            MeshAttributes { normals: Some(&normals), colors: None, scalars: Some(&scalars) };
        let ids: Vec<u32> = (0..200).step_by(3).collect();
        for tolerance in [0.0, 0.5] {
            let corners = |id: u32| [id, id + 50, id + 100];
            let sound = encode(ids.clone(), corners, &mesh, tolerance);
            assert!(PageAttributes::of_words(sound.clone()).is_ok());
            let mut refused = 0;
            for _ in 0..20_000 {
                let mut words = sound.clone();
                match r.bits() % 4 {
                    0 => words.truncate(r.bits() as usize % sound.len()),
                    1 => words.push(r.bits() as u32),
                    _ => {
                        let at = r.bits() as usize % if r.unit() < 0.5 { 8 } else { words.len() };
                        words[at] ^= 1 << (r.bits() % 32);
                    }
                }
                match PageAttributes::of_words(words) {
                    Err(_) => refused += 1,
                    Ok(found) => ids.iter().for_each(|&id| {
                        found.at(id, [0.2, 0.3, 0.5]);
                    }),
                }
            }
            assert!(refused > 10_000, "{refused}");
        }
    }
}

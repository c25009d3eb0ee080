//! Settings as named fields with digests, to compare what ranks say without sending it.
//!
//! A setting is written as [`Debug`] writes it, which gives every number its shortest exact form,
//! into a sink that hashes. So two settings have one digest when they have the same fields, to the
//! last bit of each number, and a colour map or texture is never copied.
use crate::codec::mix;
use crate::mix64::mix64;
use std::fmt::{Debug, Write};

/// Longest text of a value in an error, bytes.
const LONGEST_TEXT: usize = 96;
/// Most fields that are described: an error names one.
pub(super) const MOST_FIELDS: usize = 4096;

/// A part of a setting.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    /// "2.color": field `color` of item 2.
    pub(super) name: String,
    pub(super) digest: u64,
    /// Its beginning.
    pub(super) text: String,
}

/// Hashes what is written to it.
struct Digest(u64);

impl Write for Digest {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.0 = hash(self.0, text);
        Ok(())
    }
}

fn hash(state: u64, text: &str) -> u64 {
    text.bytes().fold(state, |state, byte| mix(state, u64::from(byte)))
}

/// A digest of the whole setting.
pub(super) fn digest_of(setting: &dyn Debug) -> u64 {
    let mut digest = Digest(0);
    // The sink takes everything.
    let _ = write!(digest, "{setting:?}");
    mix64(digest.0)
}

/// The fields of a setting: those of a struct, or those of each item of a list.
pub(super) fn fields_of(setting: &dyn Debug) -> Vec<Field> {
    let mut fields = Fields::default();
    let _ = write!(fields, "{setting:#?}");
    fields.end_line();
    for field in &mut fields.all {
        field.text = field.text.trim_start().trim_end_matches([',', ' ']).to_owned();
    }
    fields.all
}

/// Splits indented lines into fields.
#[derive(Default)]
struct Fields {
    all: Vec<Field>,
    /// Levels around the setting: one for `Some`.
    around: usize,
    /// The label of the item that the lines belong to.
    item: String,
    items: usize,
    line: String,
}

impl Write for Fields {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        for (k, piece) in text.split('\n').enumerate() {
            if k > 0 {
                self.end_line();
            }
            self.line.push_str(piece);
        }
        Ok(())
    }
}

impl Fields {
    /// Adds a line to the field that it belongs to, by its indentation.
    fn end_line(&mut self) {
        let line = std::mem::take(&mut self.line);
        let content = line.trim_start();
        if self.all.is_empty() && content == "Some(" {
            self.around = 1;
            return;
        }
        let level = ((line.len() - content.len()) / 4).saturating_sub(self.around);
        let label = || {
            let word = content.split(": ").next().filter(|w| w.len() < content.len())?;
            word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_').then_some(word)
        };
        // The end of an item must not count as a part of its last field.
        if level <= 2 && content.starts_with([')', ']', '}']) {
            return;
        }
        let name = match level {
            0 if self.all.is_empty() => Some(String::new()),
            1 => {
                self.item = label().map_or_else(|| self.items.to_string(), str::to_owned);
                self.items += 1;
                Some(self.item.clone())
            }
            2 => label().map(|label| format!("{}.{label}", self.item)),
            _ => None,
        };
        let new = name.is_some();
        if let Some(name) = name
            && self.all.len() < MOST_FIELDS
        {
            self.all.push(Field { name, digest: 0, text: String::new() });
        }
        let Some(field) = self.all.last_mut() else { return };
        field.digest = hash(field.digest, content);
        let value = if new { label().map_or(0, |label| label.len() + 2) } else { 0 };
        for c in content[value..].trim_end_matches(['{', '(', '[']).chars() {
            if field.text.len() < LONGEST_TEXT {
                field.text.push(c);
            }
        }
        if field.text.len() < LONGEST_TEXT {
            field.text.push(' ');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::camera::Camera;
    use rt_core::glam::DVec3;
    use rt_core::light::Light;

    #[test]
    fn one_changed_number_changes_one_field_and_the_digest() {
        let lights = [Light::directional(DVec3::X), Light::point(DVec3::Y).with_color([1.0; 3])];
        let mut others = lights;
        others[1].color[2] = f32::from_bits(1.0f32.to_bits() + 1);
        let (a, b) = (fields_of(&lights), fields_of(&others));
        assert_eq!(a.len(), b.len());
        let differ: Vec<&str> =
            a.iter().zip(&b).filter(|(a, b)| a != b).map(|(a, _)| a.name.as_str()).collect();
        assert_eq!(differ, ["1.color"]);
        assert_ne!(digest_of(&lights), digest_of(&others));
        assert_eq!(digest_of(&lights), digest_of(&lights.to_vec()));
    }

    #[test]
    fn a_list_that_ends_earlier_lacks_an_item_and_differs_in_no_other() {
        let lights = [Light::directional(DVec3::X), Light::headlight()];
        let (two, one) = (fields_of(&lights), fields_of(&&lights[..1]));
        assert_eq!(two[..one.len()], one);
        assert_eq!((two[one.len()].name.as_str(), two[0].name.as_str()), ("1", ""));
    }

    #[test]
    fn fields_of_an_optional_setting_have_their_own_names() {
        let ao = rt_core::scene::AmbientOcclusion { distance: 0.5, rays: 8 };
        let names: Vec<String> = fields_of(&Some(ao)).into_iter().map(|f| f.name).collect();
        assert_eq!(names, ["", "distance", "rays"]);
        assert_eq!(fields_of(&Some(ao))[1].text, "0.5");
        assert_eq!(fields_of(&None::<u32>)[0].text, "None");
    }

    #[test]
    fn fields_of_a_camera_have_their_names() {
        let eye = DVec3::new(0.0, 0.0, 9.0);
        let camera =
            Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.6, 1.0, [0.1, 10.0]).unwrap();
        let fields = fields_of(&camera);
        let field = fields.iter().find(|f| f.name == "depth_range");
        assert_eq!(field.map(|f| f.text.as_str()), Some("0.0, 1.0"));
    }

    #[test]
    fn long_values_are_cut_but_hashed_whole() {
        let (mut a, b) = (vec![vec![0u8; 5000]], vec![vec![0u8; 5000]]);
        a[0][4999] = 1;
        let (a, b) = (fields_of(&a), fields_of(&b));
        assert_ne!(a.last().map(|f| f.digest), b.last().map(|f| f.digest));
        assert!(a.iter().all(|f| f.text.len() <= LONGEST_TEXT + 4));
    }
}

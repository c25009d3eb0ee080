//! Finds out where ranks contradict each other, and says so on all of them.
use super::fields::{Field, MOST_FIELDS, digest_of, fields_of};
use super::words::{Reader, Writer};
use crate::render::FrameError;
use crate::render::request_reply::RankChannel;
use std::fmt::Debug;

/// Longest name or text that is read, bytes.
const LONGEST: usize = 4096;

/// A setting that must be the same on all ranks, with its name in errors.
pub(in crate::render) type Setting<'a> = (&'static str, &'a dyn Debug);

/// Compares settings across all ranks, by digests. Only when some differ, their fields are
/// exchanged.
///
/// # Errors
/// [`FrameError::Contradiction`] on every rank, or errors of the transport.
pub(in crate::render) fn agree_on(
    channel: &mut RankChannel<'_>,
    settings: &[Setting<'_>],
) -> Result<(), FrameError> {
    if channel.size() == 1 {
        return Ok(());
    }
    let mut digests = Writer::default();
    settings.iter().for_each(|(_, setting)| digests.u64(digest_of(setting)));
    let all = channel.all_gather(&digests.0)?;
    let differs =
        |k: usize| all.iter().any(|of_rank| of_rank[2 * k..][..2] != all[0][2 * k..][..2]);
    let Some(&(what, setting)) = (0..settings.len()).find(|&k| differs(k)).map(|k| &settings[k])
    else {
        return Ok(());
    };
    let mut mine = Writer::default();
    let fields = fields_of(setting);
    mine.u32(fields.len() as u32);
    for field in &fields {
        mine.text(&field.name);
        mine.u64(field.digest);
        mine.text(&field.text);
    }
    let all = channel.all_gather_varying(&mine.0)?;
    let mut fields = Vec::with_capacity(all.len());
    for (from, words) in all.iter().enumerate() {
        let read = read_fields(words);
        fields.push(read.ok_or_else(|| channel.message_error(from, what, words.len()))?);
    }
    Err(first_difference(what, &fields))
}

fn read_fields(words: &[u32]) -> Option<Vec<Field>> {
    let mut reader = Reader(words);
    let count = reader.count(4)?;
    if count > MOST_FIELDS {
        return None;
    }
    let field = |_| {
        let (name, digest) = (reader.text(LONGEST)?, reader.u64()?);
        Some(Field { name, digest, text: reader.text(LONGEST)? })
    };
    let fields: Vec<Field> = (0..count).map(field).collect::<Option<_>>()?;
    reader.is_at_end().then_some(fields)
}

/// The error that names the first field in which ranks differ.
fn first_difference(what: &str, fields: &[Vec<Field>]) -> FrameError {
    let longest = fields.iter().map(Vec::len).max().unwrap_or(0);
    let differs = |k: usize| fields.iter().any(|of_rank| of_rank.get(k) != fields[0].get(k));
    let k = (0..longest).find(|&k| differs(k));
    let at = |of_rank: &Vec<Field>| k.and_then(|k| of_rank.get(k)).cloned();
    let name = fields.iter().find_map(at).map_or_else(String::new, |field| field.name);
    let values = fields.iter().map(|of_rank| match at(of_rank) {
        Some(field) if field.name == name => (field.digest, field.text.trim().to_owned()),
        _ => (0, "missing".to_owned()),
    });
    contradiction(what, &name, values)
}

/// The error about `field` of `what`, with the value of each rank: what tells it from others, and
/// its text.
pub(super) fn contradiction<K: PartialEq>(
    what: &str,
    field: &str,
    values: impl Iterator<Item = (K, String)>,
) -> FrameError {
    let ranks = values.enumerate().map(|(rank, (key, text))| (rank, key, text));
    contradiction_among(what, field, ranks)
}

/// The same for some ranks.
pub(super) fn contradiction_among<K: PartialEq>(
    what: &str,
    field: &str,
    values: impl Iterator<Item = (usize, K, String)>,
) -> FrameError {
    let mut groups: Vec<(K, String, Vec<usize>)> = Vec::new();
    for (rank, key, text) in values {
        match groups.iter_mut().find(|(k, ..)| *k == key) {
            Some((.., ranks)) => ranks.push(rank),
            None => groups.push((key, text, vec![rank])),
        }
    }
    let said: Vec<String> =
        groups.iter().map(|(_, text, ranks)| format!("{text} on {}", names_of(ranks))).collect();
    FrameError::Contradiction {
        what: what.to_owned(),
        field: field.to_owned(),
        values: said.join("; "),
    }
}

/// "rank 3", "ranks 0 to 6, 9".
fn names_of(ranks: &[usize]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &rank in ranks {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == rank => *last = rank,
            _ => runs.push((rank, rank)),
        }
    }
    let run = |&(first, last): &(usize, usize)| match last - first {
        0 => first.to_string(),
        1 => format!("{first}, {last}"),
        _ => format!("{first} to {last}"),
    };
    let list = runs.iter().map(run).collect::<Vec<_>>().join(", ");
    format!("rank{} {list}", if ranks.len() == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_listed_in_runs() {
        assert_eq!(names_of(&[3]), "rank 3");
        assert_eq!(names_of(&[0, 1]), "ranks 0, 1");
        assert_eq!(names_of(&[0, 1, 2, 5, 7, 8]), "ranks 0 to 2, 5, 7, 8");
    }

    #[test]
    fn fields_that_are_cut_short_are_refused() {
        let mut words = Writer::default();
        words.u32(2);
        for name in ["color", "kind"] {
            words.text(name);
            words.u64(7);
            words.text("1.0");
        }
        assert_eq!(read_fields(&words.0).map(|f| f.len()), Some(2));
        for end in 0..words.0.len() {
            assert_eq!(read_fields(&words.0[..end]), None, "{end} words");
        }
        words.0[0] = u32::MAX;
        assert_eq!(read_fields(&words.0), None);
    }
}

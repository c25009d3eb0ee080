//! The filters of a chunk: deflate, shuffle, fletcher32.

use super::header::Message;
use super::source::{Source, unknown_version};
use crate::read::error::{At, BROKEN, Fault, TRUNCATED};
use std::io::Read;

/// One step of a filter pipeline.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Filter {
    Deflate,
    /// The size of an element.
    Shuffle(usize),
    Fletcher32,
}

/// Decodes a filter pipeline message. Filters that are not read are refused by name.
pub(super) fn pipeline(source: &Source, message: &Message) -> Result<Vec<Filter>, Fault> {
    let mut f = source.fields(&message.data, message.address);
    let at = f.at();
    let version = f.u8()?;
    let count = f.u8()?;
    match version {
        1 => f.skip(6)?,
        2 => {}
        v => return Err(unknown_version(at, v, "a filter pipeline")),
    }
    let mut out = Vec::new();
    for _ in 0..count {
        let at = f.at();
        let id = f.u16()?;
        let name_length = if version == 1 || id >= 256 { f.u16()? } else { 0 };
        f.skip(2)?;
        let values = usize::from(f.u16()?);
        let name = f.take(usize::from(name_length))?;
        let name: Vec<u8> = name.iter().copied().take_while(|&b| b != 0).collect();
        let first = if values > 0 { f.u32()? } else { 0 };
        f.skip(4 * values.saturating_sub(1))?;
        f.skip(if version == 1 && values % 2 == 1 { 4 } else { 0 })?;
        out.push(match id {
            1 => Filter::Deflate,
            2 => Filter::Shuffle(first as usize),
            3 => Filter::Fletcher32,
            _ => {
                let known = match id {
                    4 => "szip".into(),
                    5 => "nbit".into(),
                    6 => "scale-offset".into(),
                    32000 => "lzf".into(),
                    32001 => "blosc".into(),
                    32004 => "lz4".into(),
                    32015 => "zstd".into(),
                    _ => String::from_utf8_lossy(&name).into_owned(),
                };
                let cure = "write it with gzip or without compression (h5repack -f GZIP=4)";
                return Err(Fault::unsupported(at, format!("the filter {id} ({known})"), cure));
            }
        });
    }
    Ok(out)
}

/// Undoes the filters of a chunk. Those in `mask` were not applied to it.
pub(super) fn undo(
    filters: &[Filter],
    mask: u32,
    mut data: Vec<u8>,
    size: usize,
    at: u64,
) -> Result<Vec<u8>, Fault> {
    let fault = |what: String, cure: &str| Fault::new(At::Byte(at), what, cure);
    for (i, filter) in filters.iter().enumerate().rev() {
        if mask.checked_shr(i as u32).unwrap_or(0) & 1 == 1 {
            continue;
        }
        data = match filter {
            Filter::Deflate => {
                if size as u64 > (data.len() as u64 + 1).saturating_mul(1040) {
                    let what = format!("{size} bytes cannot come from {} packed", data.len());
                    return Err(fault(what, BROKEN));
                }
                // A checksum may have been packed with the values.
                let most = size as u64 + 4;
                let mut out = Vec::with_capacity(size);
                let read =
                    flate2::read::ZlibDecoder::new(&data[..]).take(most).read_to_end(&mut out);
                read.map_err(|e| fault(format!("a chunk cannot be unpacked: {e}"), TRUNCATED))?;
                out
            }
            Filter::Shuffle(each) => unshuffle(&data, *each),
            Filter::Fletcher32 => {
                let Some((values, stored)) = data.split_last_chunk::<4>() else {
                    return Err(fault("a chunk is shorter than its checksum".into(), TRUNCATED));
                };
                let found = fletcher32(values);
                // HDF5 before 1.6.3 swapped the bytes of both sums.
                let stored = u32::from_le_bytes(*stored);
                let old = (stored & 0x00ff_00ff) << 8 | (stored & 0xff00_ff00) >> 8;
                if found != stored && found != old {
                    let what = format!("the checksum of a chunk is {found:08x}, not {stored:08x}");
                    return Err(fault(what, "the file is damaged: copy or write it again"));
                }
                values.to_vec()
            }
        };
    }
    if data.len() != size {
        let what = format!("a chunk has {} bytes instead of {size}", data.len());
        return Err(fault(what, TRUNCATED));
    }
    Ok(data)
}

/// Puts the bytes of each element together again.
fn unshuffle(data: &[u8], each: usize) -> Vec<u8> {
    let count = data.len().checked_div(each).unwrap_or(0);
    let mut out = vec![0; data.len()];
    for byte in 0..each.min(data.len()) {
        for i in 0..count {
            out[i * each + byte] = data[byte * count + i];
        }
    }
    // What is left of an element stays where it is.
    out[count * each..].copy_from_slice(&data[count * each..]);
    out
}

/// Fletcher's checksum over words of two bytes, the first of which counts more.
fn fletcher32(data: &[u8]) -> u32 {
    let fold = |s: u32| (s & 0xffff) + (s >> 16);
    let (mut low, mut high) = (0u32, 0u32);
    // 360 words cannot overflow the sums.
    for block in data.chunks(720) {
        for word in block.chunks(2) {
            low += u32::from(word[0]) << 8 | word.get(1).map_or(0, |&b| u32::from(b));
            high += low;
        }
        (low, high) = (fold(low), fold(high));
    }
    fold(high) << 16 | fold(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_bytes_come_back_and_a_rest_stays() {
        assert_eq!(unshuffle(&[1, 3, 2, 4, 9], 2), [1, 2, 3, 4, 9]);
        assert_eq!(unshuffle(&[1, 2], 0), [1, 2]);
        assert_eq!(unshuffle(&[1, 2], 5), [1, 2]);
    }

    #[test]
    fn a_wrong_checksum_is_found() {
        let mut chunk = vec![1, 2, 3, 4, 5, 6];
        chunk.extend(fletcher32(&chunk).to_le_bytes());
        let filters = [Filter::Fletcher32];
        assert_eq!(undo(&filters, 0, chunk.clone(), 6, 0).unwrap(), [1, 2, 3, 4, 5, 6]);
        assert_eq!(undo(&filters, 1, chunk.clone(), 10, 0).unwrap(), chunk);
        chunk[2] = 7;
        assert!(undo(&filters, 0, chunk, 6, 0).unwrap_err().what.contains("checksum"));
    }
}

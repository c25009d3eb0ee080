//! Object headers, versions 1 and 2: lists of messages that describe a group or a dataset.

use super::source::{Source, unknown_version, verify};
use crate::read::error::{At, BROKEN, Fault};

/// The types of the messages that are read.
pub(super) mod kind {
    pub(in super::super) const DATASPACE: u16 = 0x01;
    pub(in super::super) const LINK_INFO: u16 = 0x02;
    pub(in super::super) const DATATYPE: u16 = 0x03;
    pub(in super::super) const OLD_FILL: u16 = 0x04;
    pub(in super::super) const FILL: u16 = 0x05;
    pub(in super::super) const LINK: u16 = 0x06;
    pub(in super::super) const EXTERNAL_FILES: u16 = 0x07;
    pub(in super::super) const LAYOUT: u16 = 0x08;
    pub(in super::super) const FILTERS: u16 = 0x0b;
    pub(in super::super) const ATTRIBUTE: u16 = 0x0c;
    pub(in super::super) const CONTINUATION: u16 = 0x10;
    pub(in super::super) const SYMBOL_TABLE: u16 = 0x11;
    pub(in super::super) const ATTRIBUTE_INFO: u16 = 0x15;
}

/// One message of an object header.
#[derive(Debug, Clone)]
pub(super) struct Message {
    pub(super) kind: u16,
    pub(super) data: Vec<u8>,
    /// Where the data begins in the file.
    pub(super) address: u64,
}

/// Most blocks of one header; more are a loop.
const MAX_BLOCKS: usize = 4096;

/// The messages of the object header at `address`.
pub(super) fn messages(source: &Source, address: u64) -> Result<Vec<Message>, Fault> {
    let head = source.at_most(address, 34, "an object header")?;
    let mut fields = source.fields(&head, address);
    let mut out = Vec::new();
    // Address and length of the blocks, and whether they have a signature.
    let mut blocks: Vec<(u64, u64)> = Vec::new();
    let is_new = head.starts_with(b"OHDR");
    let mut has_order = false;
    let mut first = None;
    if is_new {
        fields.skip(4)?;
        fields.version(2, "an object header")?;
        let flags = fields.u8()?;
        has_order = flags & 4 != 0;
        fields.skip(if flags & 0x20 != 0 { 16 } else { 0 })?;
        fields.skip(if flags & 0x10 != 0 { 4 } else { 0 })?;
        let size = fields.uint(1 << (flags & 3))?;
        let prefix = fields.pos as u64;
        let whole = source.bytes(address, size.saturating_add(prefix + 4), "an object header")?;
        verify(&whole, address)?;
        first = Some((whole, prefix as usize));
    } else {
        let at = fields.at();
        match fields.u8()? {
            1 => {}
            v => return Err(unknown_version(at, v, "an object header")),
        }
        fields.skip(7)?;
        blocks.push((address.saturating_add(16), u64::from(fields.u32()?)));
    }
    let mut done = 0;
    loop {
        let (block, address, skip, tail) = if let Some((whole, prefix)) = first.take() {
            (whole, address, prefix, 4)
        } else if let Some(&(address, length)) = blocks.get(done) {
            done += 1;
            let block = source.bytes(address, length, "a block of an object header")?;
            if is_new {
                source.fields(&block, address).signature(b"OCHK")?;
                verify(&block, address)?;
                (block, address, 4, 4)
            } else {
                (block, address, 0, 0)
            }
        } else {
            return Ok(out);
        };
        if done > MAX_BLOCKS {
            let what = format!("an object header of more than {MAX_BLOCKS} blocks");
            return Err(Fault::new(At::Byte(address), what, BROKEN));
        }
        let end = block.len() - tail;
        let mut fields = source.fields(&block[..end], address);
        fields.skip(skip)?;
        let prefix = match (is_new, has_order) {
            (false, _) => 8,
            (true, true) => 6,
            (true, false) => 4,
        };
        while fields.remaining() >= prefix {
            let (kind, size, flags);
            if is_new {
                kind = u16::from(fields.u8()?);
                size = fields.u16()?;
                flags = fields.u8()?;
                fields.skip(if has_order { 2 } else { 0 })?;
            } else {
                kind = fields.u16()?;
                size = fields.u16()?;
                flags = fields.u8()?;
                fields.skip(3)?;
            }
            let address = address.saturating_add(fields.pos as u64);
            let data = fields.take(usize::from(size))?;
            if kind == kind::CONTINUATION {
                let mut f = source.fields(data, address);
                let block = f.defined("a block of an object header")?;
                blocks.push((block, f.length()?));
            } else if kind != 0 {
                let mut m = Message { kind, data: data.to_vec(), address };
                if flags & 2 != 0 {
                    m = shared(source, &m)?;
                }
                out.push(m);
            }
        }
    }
}

/// The message that a shared one stands for: that of a named datatype.
pub(super) fn shared(source: &Source, message: &Message) -> Result<Message, Fault> {
    let mut f = source.fields(&message.data, message.address);
    let version = f.u8()?;
    let kind = f.u8()?;
    if version == 3 && kind == 1 {
        let cure = "repack the file with h5repack";
        return Err(Fault::unsupported(f.at(), "a table of shared messages", cure));
    }
    f.skip(if version == 1 { 6 } else { 0 })?;
    let address = f.defined("a shared message")?;
    // A committed datatype is not shared itself, so this ends.
    let head = source.at_most(address, 1 << 16, "a named datatype")?;
    let found = unshared(source, &head, address)?.into_iter().find(|m| m.kind == message.kind);
    found.ok_or_else(|| {
        Fault::new(At::Byte(address), "no message where a shared one points", BROKEN)
    })
}

/// The messages in the first block of a header, without those that are shared.
fn unshared(source: &Source, head: &[u8], address: u64) -> Result<Vec<Message>, Fault> {
    let mut f = source.fields(head, address);
    let mut out = Vec::new();
    let (is_new, has_order, size);
    if head.starts_with(b"OHDR") {
        f.skip(5)?;
        let flags = f.u8()?;
        is_new = true;
        has_order = flags & 4 != 0;
        f.skip(if flags & 0x20 != 0 { 16 } else { 0 })?;
        f.skip(if flags & 0x10 != 0 { 4 } else { 0 })?;
        size = f.uint(1 << (flags & 3))?;
    } else {
        f.skip(8)?;
        is_new = false;
        has_order = false;
        size = u64::from(f.u32()?);
        f.skip(4)?;
    }
    let end = (f.pos as u64).saturating_add(size);
    while (f.pos as u64).saturating_add(8) <= end && f.remaining() >= 8 {
        let kind = if is_new { u16::from(f.u8()?) } else { f.u16()? };
        let size = f.u16()?;
        let flags = f.u8()?;
        f.skip(match (is_new, has_order) {
            (true, true) => 2,
            (true, false) => 0,
            (false, _) => 3,
        })?;
        let at = address.saturating_add(f.pos as u64);
        let data = f.take(usize::from(size))?.to_vec();
        if flags & 2 == 0 {
            out.push(Message { kind, data, address: at });
        }
    }
    Ok(out)
}

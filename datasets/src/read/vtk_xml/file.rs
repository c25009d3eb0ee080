//! A VTK XML file as an element tree plus the bytes appended to it.

use super::blocks::{Compressor, EncodedBytes, Encoding, decode};
use crate::model::{DataArray, Endian, ScalarType, Values};
use crate::read::error::{At, BROKEN, Fault};
use roxmltree::Node;

/// The two parts of a file: XML text, and bytes after `_` that need not be XML.
pub(crate) struct XmlWithAppendedData<'a> {
    /// The XML, with an empty `AppendedData` element.
    pub(crate) head: String,
    /// Everything after the underscore, including the closing tags.
    pub(crate) appended: &'a [u8],
}

/// Splits the file at the appended data, which may be raw bytes that no XML parser accepts.
pub(crate) fn split(bytes: &[u8]) -> Result<XmlWithAppendedData<'_>, Fault> {
    const TAG: &[u8] = b"<AppendedData";
    let find = |what: &[u8], from: usize| {
        bytes[from..].windows(what.len()).position(|w| w == what).map(|i| i + from)
    };
    let (head, appended) = match find(TAG, 0) {
        None => (bytes, &bytes[bytes.len()..]),
        Some(tag) => {
            let Some(close) = find(b">", tag) else {
                return Err(Fault::new(
                    At::Byte(tag as u64),
                    "the AppendedData tag does not end",
                    BROKEN,
                ));
            };
            let data = bytes[close..]
                .iter()
                .position(|&b| b == b'_')
                .map_or(bytes.len(), |i| close + i + 1);
            (&bytes[..=close], &bytes[data..])
        }
    };
    let mut text = match std::str::from_utf8(head) {
        Ok(t) => t.to_string(),
        Err(e) => {
            let at = At::Byte(e.valid_up_to() as u64);
            return Err(Fault::new(at, "the XML part is not UTF-8 text", BROKEN));
        }
    };
    if head.len() < bytes.len() && !text.ends_with("/>") {
        text.push_str("</AppendedData>");
    }
    if head.len() < bytes.len() {
        text.push_str("</VTKFile>");
    }
    Ok(XmlWithAppendedData { head: text, appended })
}

/// A parsed file.
pub(crate) struct XmlFile<'a> {
    /// The `VTKFile` element.
    pub(crate) root: Node<'a, 'a>,
    encoding: Result<Encoding, Fault>,
    appended: &'a [u8],
    appended_is_raw: bool,
}

/// Parser options that keep small texts from growing into large trees.
pub(crate) fn parse_tree(text: &str) -> Result<roxmltree::Document<'_>, Fault> {
    let options =
        roxmltree::ParsingOptions { allow_dtd: false, nodes_limit: u32::MAX, ..Default::default() };
    roxmltree::Document::parse_with_options(text, options).map_err(|e| {
        Fault::new(
            At::Line(u64::from(e.pos().row)),
            format!("the XML cannot be parsed: {e}"),
            BROKEN,
        )
    })
}

impl<'a> XmlFile<'a> {
    pub(crate) fn new(
        tree: &'a roxmltree::Document<'a>,
        appended: &'a [u8],
    ) -> Result<Self, Fault> {
        let root = tree.root_element();
        if root.tag_name().name() != "VTKFile" {
            let what = format!("the first element is `{}`, not `VTKFile`", root.tag_name().name());
            return Err(Fault::new(
                At::Field("the XML".into()),
                what,
                "this is another kind of XML file",
            ));
        }
        let endian = match root.attribute("byte_order") {
            None | Some("LittleEndian") => Endian::Little,
            Some("BigEndian") => Endian::Big,
            Some(other) => {
                return Err(bad_attribute(root, "byte_order", other, "LittleEndian or BigEndian"));
            }
        };
        let header_bytes = match root.attribute("header_type") {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => {
                return Err(bad_attribute(root, "header_type", other, "UInt32 or UInt64"));
            }
        };
        // An unsupported compressor is an error only if an array needs it.
        let encoding = match root.attribute("compressor") {
            None | Some("") => Ok(Compressor::None),
            Some("vtkZLibDataCompressor") => Ok(Compressor::Zlib),
            Some("vtkLZ4DataCompressor") => Ok(Compressor::Lz4),
            Some(other) => {
                let name = if other == "vtkLZMADataCompressor" { "LZMA" } else { other };
                Err(Fault::unsupported(
                    At::Field("attribute `compressor` of VTKFile".into()),
                    format!("{name} compression"),
                    "write it again with ZLib or LZ4 compression, or with none (in ParaView: Save \
                     Data, Compressor Type)",
                ))
            }
        }
        .map(|compressor| Encoding { endian, header_bytes, compressor });
        let tag = root.children().find(|n| n.has_tag_name("AppendedData"));
        let appended_is_raw = match tag.and_then(|n| n.attribute("encoding")) {
            Some("raw") => true,
            None | Some("base64") => false,
            Some(other) => return Err(bad_attribute(root, "encoding", other, "raw or base64")),
        };
        Ok(XmlFile { root, encoding, appended, appended_is_raw })
    }

    /// The array in element `node`. `Ok(None)` means that its type is skipped, with a warning.
    pub(crate) fn array(
        &self,
        node: Node<'_, '_>,
        warnings: &mut Vec<String>,
    ) -> Result<Option<DataArray>, Fault> {
        let kind_name = node.attribute("type").unwrap_or("");
        let Some((name, components, kind)) = array_description(node)? else {
            let name = node.attribute("Name").unwrap_or("");
            warnings.push(format!("array `{name}` left out: type `{kind_name}` is not read"));
            return Ok(None);
        };
        let place = || At::Field(format!("array `{name}`"));
        let values = match node.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let text = node.text().unwrap_or("");
                Values::from_words(kind, text.split_ascii_whitespace()).map_err(|w| {
                    let shown: String = w.chars().take(40).collect();
                    Fault::new(
                        place(),
                        format!("`{shown}` is not a number of type {kind_name}"),
                        BROKEN,
                    )
                })?
            }
            "binary" => {
                let e = self.encoding.clone()?;
                let bytes =
                    decode(EncodedBytes::Base64(node.text().unwrap_or("").as_bytes()), e, &name)?;
                self.typed(kind, bytes, e, &name)?
            }
            "appended" => {
                let e = self.encoding.clone()?;
                let text = node.attribute("offset").unwrap_or("");
                let offset =
                    text.trim().parse::<usize>().ok().filter(|&o| o <= self.appended.len());
                let Some(offset) = offset else {
                    let allowed =
                        format!("at most {}, where the appended data ends", self.appended.len());
                    return Err(bad_attribute(node, "offset", text, &allowed));
                };
                let rest = &self.appended[offset..];
                let stored = if self.appended_is_raw {
                    EncodedBytes::Raw(rest)
                } else {
                    EncodedBytes::Base64(rest)
                };
                self.typed(kind, decode(stored, e, &name)?, e, &name)?
            }
            other => return Err(bad_attribute(node, "format", other, "ascii, binary or appended")),
        };
        if !values.len().is_multiple_of(components) {
            let what = format!("{} values do not make whole tuples of {components}", values.len());
            return Err(Fault::new(place(), what, BROKEN));
        }
        Ok(Some(DataArray { name, components, values }))
    }

    /// How arrays are stored; `None` if that cannot be read.
    pub(super) fn encoding(&self) -> Option<Encoding> {
        self.encoding.clone().ok()
    }

    pub(super) fn appended_is_raw(&self) -> bool {
        self.appended_is_raw
    }

    fn typed(
        &self,
        kind: ScalarType,
        bytes: Vec<u8>,
        e: Encoding,
        name: &str,
    ) -> Result<Values, Fault> {
        if !bytes.len().is_multiple_of(kind.size()) {
            let what =
                format!("{} bytes are no whole number of {} values", bytes.len(), kind.vtk_name());
            return Err(Fault::field(format!("array `{name}`"), what));
        }
        Ok(match kind {
            ScalarType::U8 => Values::U8(bytes),
            _ => Values::from_bytes(kind, &bytes, e.endian),
        })
    }

    /// The strings of an array of type `String`: characters as numbers, each string terminated by a
    /// zero.
    pub(crate) fn texts(&self, node: Node<'_, '_>) -> Result<Vec<String>, Fault> {
        let name = node.attribute("Name").unwrap_or("");
        let bytes = match node.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                match Values::from_words(
                    ScalarType::U8,
                    node.text().unwrap_or("").split_ascii_whitespace(),
                ) {
                    Ok(Values::U8(v)) => v,
                    _ => {
                        return Err(Fault::field(
                            format!("array `{name}`"),
                            "letters must be numbers below 256",
                        ));
                    }
                }
            }
            "binary" => decode(
                EncodedBytes::Base64(node.text().unwrap_or("").as_bytes()),
                self.encoding.clone()?,
                name,
            )?,
            _ => {
                let offset = node.attribute("offset").and_then(|t| t.trim().parse::<usize>().ok());
                let Some(rest) = offset.and_then(|o| self.appended.get(o..)) else {
                    return Err(Fault::field(
                        format!("array `{name}`"),
                        "its offset is outside the file",
                    ));
                };
                let stored = if self.appended_is_raw {
                    EncodedBytes::Raw(rest)
                } else {
                    EncodedBytes::Base64(rest)
                };
                decode(stored, self.encoding.clone()?, name)?
            }
        };
        let mut texts: Vec<String> =
            bytes.split(|&b| b == 0).map(|t| String::from_utf8_lossy(t).into_owned()).collect();
        texts.pop_if(|t| t.is_empty());
        Ok(texts)
    }
}

/// The name of an array, its values per tuple and their type; `None` for a type that is not read.
pub(super) fn array_description(
    node: Node<'_, '_>,
) -> Result<Option<(String, usize, ScalarType)>, Fault> {
    let Some(kind) = scalar_type(node.attribute("type").unwrap_or("")) else { return Ok(None) };
    let components = match node.attribute("NumberOfComponents") {
        None => 1,
        Some(text) => match text.trim().parse::<usize>() {
            Ok(n) => n.max(1),
            Err(_) => {
                return Err(bad_attribute(node, "NumberOfComponents", text, "a whole number"));
            }
        },
    };
    Ok(Some((node.attribute("Name").unwrap_or("").to_string(), components, kind)))
}

/// The scalar type with the given name in XML files, including older names.
pub(crate) fn scalar_type(name: &str) -> Option<ScalarType> {
    match name {
        "vtkIdType" => Some(ScalarType::I64),
        "float" => Some(ScalarType::F32),
        "double" => Some(ScalarType::F64),
        "int" => Some(ScalarType::I32),
        _ => ScalarType::ALL.into_iter().find(|t| t.vtk_name() == name),
    }
}

/// The fault for an attribute with an invalid value.
pub(crate) fn bad_attribute(
    node: Node<'_, '_>,
    attribute: &str,
    value: &str,
    allowed: &str,
) -> Fault {
    let value: String = value.chars().take(60).collect();
    let name = node.attribute("Name").map(|n| format!(" `{n}`")).unwrap_or_default();
    let at = At::Field(format!("attribute `{attribute}` of {}{name}", node.tag_name().name()));
    Fault::new(at, format!("its value is `{value}`"), format!("it must be {allowed}"))
}

/// `count` numbers in an attribute.
pub(crate) fn attribute_numbers<T: std::str::FromStr, const N: usize>(
    node: Node<'_, '_>,
    attribute: &str,
) -> Result<Option<[T; N]>, Fault> {
    let Some(text) = node.attribute(attribute) else { return Ok(None) };
    let list: Result<Vec<T>, _> = text.split_ascii_whitespace().map(str::parse).collect();
    match list.ok().and_then(|l| <[T; N]>::try_from(l).ok()) {
        Some(numbers) => Ok(Some(numbers)),
        None => Err(bad_attribute(node, attribute, text, &format!("{N} numbers"))),
    }
}

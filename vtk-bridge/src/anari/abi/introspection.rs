//! Answers to `anariGetObjectSubtypes`, `anariGetObjectInfo` and `anariGetParameterInfo`. They are
//! made once from the schema and never freed.

use super::text::{StaticList, forever};
use crate::anari::data_type::DataType;
use crate::anari::schema::{self, Default, Parameter};
use std::collections::BTreeMap;
use std::ffi::{c_char, c_int, c_void};
use std::sync::OnceLock;

/// ANARI's `ANARIParameter`.
#[repr(C)]
struct ParameterEntry {
    name: *const c_char,
    data_type: c_int,
}

/// The answers about one parameter.
struct ParameterInfo {
    about: *const c_char,
    extension: *const c_char,
    required: c_int,
    default: Vec<f32>,
    whole: Option<u32>,
    text: Option<*const c_char>,
    minimum: Vec<f32>,
    maximum: Vec<f32>,
    whole_range: Option<[u32; 2]>,
    values: Option<StaticList>,
    type_values: Vec<u32>,
    elements: Vec<u32>,
}

struct ObjectInfo {
    about: *const c_char,
    extension: *const c_char,
    parameters: Vec<ParameterEntry>,
    channels: Option<StaticList>,
    by_name: BTreeMap<&'static str, ParameterInfo>,
}

/// All answers, in a form that pointers can refer to.
pub(super) struct Introspection {
    objects: BTreeMap<(DataType, &'static str), ObjectInfo>,
    subtypes: BTreeMap<DataType, StaticList>,
    extensions: StaticList,
}

// SAFETY: all pointers refer to memory of this value or to strings that are never freed, and
// nothing changes after `get` made it.
unsafe impl Send for Introspection {}
// SAFETY: as above.
unsafe impl Sync for Introspection {}

impl Introspection {
    pub(super) fn get() -> &'static Introspection {
        static ALL: OnceLock<Introspection> = OnceLock::new();
        ALL.get_or_init(Introspection::new)
    }

    fn new() -> Introspection {
        let named: Vec<String> = schema::EXTENSIONS.iter().map(|e| format!("ANARI_{e}")).collect();
        let mut subtypes: BTreeMap<DataType, Vec<&str>> = BTreeMap::new();
        let mut objects = BTreeMap::new();
        for object in schema::objects() {
            if !object.subtype.is_empty() {
                subtypes.entry(object.kind).or_default().push(object.subtype);
            }
            let mut parameters: Vec<ParameterEntry> = object
                .parameters()
                .flat_map(|p| {
                    let name = forever(p.name);
                    p.types.iter().map(move |t| ParameterEntry { name, data_type: t.0 as c_int })
                })
                .collect();
            parameters.push(ParameterEntry { name: std::ptr::null(), data_type: 0 });
            let channels = (object.kind == DataType::FRAME).then(|| {
                StaticList::new(
                    object.parameters().map(|p| p.name).filter(|n| n.starts_with("channel.")),
                )
            });
            let info = ObjectInfo {
                about: forever(object.about),
                extension: extension(object.extension),
                parameters,
                channels,
                by_name: object.parameters().map(|p| (p.name, info(p))).collect(),
            };
            objects.insert((object.kind, object.subtype), info);
        }
        Introspection {
            objects,
            subtypes: subtypes
                .into_iter()
                .map(|(kind, names)| (kind, StaticList::new(names)))
                .collect(),
            extensions: StaticList::new(named.iter().map(String::as_str)),
        }
    }

    pub(super) fn extensions(&self) -> *const *const c_char {
        self.extensions.0.as_ptr()
    }

    /// Null for kinds without subtypes.
    pub(super) fn subtypes(&self, kind: DataType) -> *const *const c_char {
        self.subtypes.get(&kind).map_or(std::ptr::null(), |l| l.0.as_ptr())
    }

    fn object(&self, kind: DataType, subtype: &str) -> Option<&ObjectInfo> {
        // Programs also query the device itself, without a subtype.
        let subtype = if kind == DataType::DEVICE { "default" } else { subtype };
        self.objects.iter().find(|((k, s), _)| *k == kind && *s == subtype).map(|(_, o)| o)
    }

    pub(super) fn object_info(
        &self,
        kind: DataType,
        subtype: &str,
        name: &str,
        wanted: DataType,
    ) -> *const c_void {
        let Some(object) = self.object(kind, subtype) else { return std::ptr::null() };
        match (name, wanted) {
            ("description", DataType::STRING) => object.about.cast(),
            ("sourceExtension", DataType::STRING) => object.extension.cast(),
            ("parameter", DataType::PARAMETER_LIST) => object.parameters.as_ptr().cast(),
            ("channel", DataType::STRING_LIST) => {
                object.channels.as_ref().map_or(std::ptr::null(), |l| l.0.as_ptr().cast())
            }
            ("extension", DataType::STRING_LIST) if kind == DataType::DEVICE => {
                self.extensions.0.as_ptr().cast()
            }
            _ => std::ptr::null(),
        }
    }

    pub(super) fn parameter_info(
        &self,
        kind: DataType,
        subtype: &str,
        parameter: &str,
        name: &str,
        wanted: DataType,
    ) -> *const c_void {
        let none = std::ptr::null();
        let Some(p) = self.object(kind, subtype).and_then(|o| o.by_name.get(parameter)) else {
            return none;
        };
        // Numbers are stored with the most components that any type needs; shorter types read a
        // prefix.
        let floats = |v: &Vec<f32>| {
            let bytes = wanted.size().unwrap_or(usize::MAX);
            if bytes <= 4 * v.len() && matches!(wanted.0, 1068..=1071 | 2008..=2017) {
                v.as_ptr().cast()
            } else {
                none
            }
        };
        let is_whole = matches!(wanted, DataType::INT32 | DataType::UINT32 | DataType::BOOL);
        let whole =
            |v: Option<&u32>| v.filter(|_| is_whole).map_or(none, |v| std::ptr::from_ref(v).cast());
        match name {
            "description" if wanted == DataType::STRING => p.about.cast(),
            "sourceExtension" if wanted == DataType::STRING => p.extension.cast(),
            "required" if wanted == DataType::BOOL => std::ptr::from_ref(&p.required).cast(),
            "default" if wanted == DataType::STRING => p.text.map_or(none, |t| t.cast()),
            "default" if is_whole => whole(p.whole.as_ref()),
            "default" => floats(&p.default),
            "minimum" if is_whole => whole(p.whole_range.as_ref().map(|r| &r[0])),
            "maximum" if is_whole => whole(p.whole_range.as_ref().map(|r| &r[1])),
            "minimum" => floats(&p.minimum),
            "maximum" => floats(&p.maximum),
            "value" if wanted == DataType::STRING_LIST => {
                p.values.as_ref().map_or(none, |l| l.0.as_ptr().cast())
            }
            "value" if wanted == DataType::DATA_TYPE_LIST && p.type_values.len() > 1 => {
                p.type_values.as_ptr().cast()
            }
            "elementType" if wanted == DataType::DATA_TYPE_LIST && p.elements.len() > 1 => {
                p.elements.as_ptr().cast()
            }
            _ => none,
        }
    }
}

fn extension(name: &str) -> *const c_char {
    if name.is_empty() { std::ptr::null() } else { forever(name) }
}

/// A list of types, terminated by 0.
fn types(list: &[DataType]) -> Vec<u32> {
    list.iter().map(|t| t.0).chain([0]).collect()
}

fn info(p: &Parameter) -> ParameterInfo {
    let longest = p.types.iter().filter_map(|t| t.size()).max().unwrap_or(4) / 4;
    let spread = |v: f32| vec![v; longest.max(1)];
    ParameterInfo {
        about: forever(p.about),
        extension: extension(p.extension),
        required: c_int::from(p.required),
        default: match p.default {
            Default::Floats(f) => f.to_vec(),
            _ => Vec::new(),
        },
        whole: match p.default {
            Default::Whole(v) => Some(v),
            _ => None,
        },
        text: match p.default {
            Default::Text(t) => Some(forever(t)),
            _ => None,
        },
        minimum: p.range.map_or(Vec::new(), |[low, _]| spread(low)),
        maximum: p.range.map_or(Vec::new(), |[_, high]| spread(high)),
        whole_range: p.range.map(|r| r.map(|v| v as u32)),
        values: (!p.values.is_empty()).then(|| StaticList::new(p.values.iter().copied())),
        type_values: types(p.type_values),
        elements: types(p.elements),
    }
}

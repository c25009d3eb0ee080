//! The objects and parameters that the device supports. One table serves both to check what
//! programs set and to answer their queries (ANARI 1.0, section "Object and parameter info").
//!
//! A parameter is in the table only if it changes what the device does.

mod geometry;
mod scene;
mod shading;
mod view;

use super::data_type::DataType;

/// Value of a parameter that is not set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Default {
    /// An unset parameter has a meaning of its own.
    None,
    /// Numbers, as FLOAT32 with as many components as the first type.
    Floats(&'static [f32]),
    /// An integer (INT32, UINT32, BOOL).
    Whole(u32),
    /// A string.
    Text(&'static str),
}

/// A parameter of an object.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// Types that it accepts.
    pub types: &'static [DataType],
    /// Element types, if it accepts an array.
    pub elements: &'static [DataType],
    /// Value when it is not set.
    pub default: Default,
    /// Strings or data types that it accepts; empty for any.
    pub values: &'static [&'static str],
    /// Data types that it accepts; empty for any.
    pub type_values: &'static [DataType],
    /// Smallest and largest sensible values.
    pub range: Option<[f32; 2]>,
    /// Whether the object requires it.
    pub required: bool,
    /// Its effect, in one sentence.
    pub about: &'static str,
    /// The extension that defines it, without `ANARI_`; empty for the core.
    pub extension: &'static str,
}

impl Parameter {
    const fn new(name: &'static str, types: &'static [DataType], about: &'static str) -> Parameter {
        Parameter {
            name,
            types,
            elements: &[],
            default: Default::None,
            values: &[],
            type_values: &[],
            range: None,
            required: false,
            about,
            extension: "",
        }
    }

    const fn array(
        name: &'static str,
        elements: &'static [DataType],
        about: &'static str,
    ) -> Parameter {
        Parameter { elements, ..Parameter::new(name, &[DataType::ARRAY1D], about) }
    }

    const fn floats(self, default: &'static [f32]) -> Parameter {
        Parameter { default: Default::Floats(default), ..self }
    }

    const fn whole(self, default: u32) -> Parameter {
        Parameter { default: Default::Whole(default), ..self }
    }

    const fn text(self, default: &'static str, values: &'static [&'static str]) -> Parameter {
        Parameter { default: Default::Text(default), values, ..self }
    }

    const fn between(self, low: f32, high: f32) -> Parameter {
        Parameter { range: Some([low, high]), ..self }
    }

    const fn required(self) -> Parameter {
        Parameter { required: true, ..self }
    }

    const fn of(self, extension: &'static str) -> Parameter {
        Parameter { extension, ..self }
    }

    /// Whether `given` is one of the accepted types.
    pub fn takes(&self, given: DataType) -> bool {
        self.types.iter().any(|t| t.accepts(given))
    }
}

/// A kind of object, or a subtype of one.
#[derive(Debug, Clone, Copy)]
pub struct ObjectSchema {
    /// The kind.
    pub kind: DataType,
    /// Its subtype; empty where the kind has none.
    pub subtype: &'static str,
    /// What it is, in one sentence.
    pub about: &'static str,
    /// The extension that defines it, without `ANARI_`; empty for the core.
    pub extension: &'static str,
    /// Its parameters, in groups that are shared between subtypes.
    groups: &'static [&'static [Parameter]],
}

impl ObjectSchema {
    /// All its parameters.
    pub fn parameters(&self) -> impl Iterator<Item = &'static Parameter> {
        NAME.iter().chain(self.groups.iter().copied().flatten())
    }

    /// The parameter with the given name.
    pub fn parameter(&self, name: &str) -> Option<&'static Parameter> {
        self.parameters().find(|p| p.name == name)
    }
}

const NAME: &[Parameter] =
    &[Parameter::new("name", &[DataType::STRING], "what messages call the object")];

/// All objects that the device can create.
pub fn objects() -> impl Iterator<Item = &'static ObjectSchema> {
    [geometry::OBJECTS, shading::OBJECTS, scene::OBJECTS, view::OBJECTS].into_iter().flatten()
}

/// The schema of a kind and subtype.
pub fn find(kind: DataType, subtype: &str) -> Option<&'static ObjectSchema> {
    objects().find(|o| o.kind == kind && o.subtype == subtype)
}

/// Subtypes of a kind; empty for kinds without subtypes.
pub fn subtypes(kind: DataType) -> impl Iterator<Item = &'static str> {
    objects().filter(move |o| o.kind == kind && !o.subtype.is_empty()).map(|o| o.subtype)
}

/// The extensions that the device supports, without `ANARI_`.
pub const EXTENSIONS: &[&str] = &[
    "KHR_ARRAY1D_REGION",
    "KHR_CAMERA_DEPTH_OF_FIELD",
    "KHR_CAMERA_OMNIDIRECTIONAL",
    "KHR_CAMERA_ORTHOGRAPHIC",
    "KHR_CAMERA_PERSPECTIVE",
    "KHR_DEVICE_SYNCHRONIZATION",
    "KHR_FRAME_ACCUMULATION",
    "KHR_FRAME_CHANNEL_ALBEDO",
    "KHR_FRAME_CHANNEL_INSTANCE_ID",
    "KHR_FRAME_CHANNEL_NORMAL",
    "KHR_FRAME_CHANNEL_OBJECT_ID",
    "KHR_FRAME_CHANNEL_PRIMITIVE_ID",
    "KHR_FRAME_COMPLETION_CALLBACK",
    "KHR_GEOMETRY_CONE",
    "KHR_GEOMETRY_CURVE",
    "KHR_GEOMETRY_CYLINDER",
    "KHR_GEOMETRY_ISOSURFACE",
    "KHR_GEOMETRY_QUAD",
    "KHR_GEOMETRY_SPHERE",
    "KHR_GEOMETRY_TRIANGLE",
    "KHR_INSTANCE_TRANSFORM",
    "KHR_INSTANCE_TRANSFORM_ARRAY",
    "KHR_LIGHT_DIRECTIONAL",
    "KHR_LIGHT_HDRI",
    "KHR_LIGHT_POINT",
    "KHR_LIGHT_QUAD",
    "KHR_LIGHT_RING",
    "KHR_LIGHT_SPOT",
    "KHR_MATERIAL_MATTE",
    "KHR_MATERIAL_PHYSICALLY_BASED",
    "KHR_RENDERER_AMBIENT_LIGHT",
    "KHR_RENDERER_BACKGROUND_COLOR",
    "KHR_RENDERER_BACKGROUND_IMAGE",
    "KHR_SAMPLER_IMAGE1D",
    "KHR_SAMPLER_IMAGE2D",
    "KHR_SAMPLER_IMAGE3D",
    "KHR_SAMPLER_IMAGExD_CLAMP_TO_BORDER",
    "KHR_SAMPLER_PRIMITIVE",
    "KHR_SAMPLER_TRANSFORM",
    "KHR_SPATIAL_FIELD_STRUCTURED_REGULAR",
    "KHR_VOLUME_TRANSFER_FUNCTION1D",
];

/// Names of attributes that a material or sampler may refer to.
pub const ATTRIBUTES: &[&str] = &[
    "color",
    "attribute0",
    "attribute1",
    "attribute2",
    "attribute3",
    "worldPosition",
    "worldNormal",
    "objectPosition",
    "objectNormal",
];

/// Element types of colour arrays and images.
const COLORS: &[DataType] = &[
    DataType::UFIXED8,
    DataType::UFIXED8_VEC2,
    DataType::UFIXED8_VEC3,
    DataType::UFIXED8_VEC4,
    DataType::UFIXED8_R_SRGB,
    DataType::UFIXED8_RA_SRGB,
    DataType::UFIXED8_RGB_SRGB,
    DataType::UFIXED8_RGBA_SRGB,
    DataType::UFIXED16,
    DataType::UFIXED16_VEC2,
    DataType::UFIXED16_VEC3,
    DataType::UFIXED16_VEC4,
    DataType::UFIXED32,
    DataType::UFIXED32_VEC2,
    DataType::UFIXED32_VEC3,
    DataType::UFIXED32_VEC4,
    DataType::FLOAT32,
    DataType::FLOAT32_VEC2,
    DataType::FLOAT32_VEC3,
    DataType::FLOAT32_VEC4,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_extension_of_the_table_is_announced() {
        for object in objects() {
            let of_parameters = object.parameters().map(|p| p.extension);
            for extension in of_parameters.chain([object.extension]).filter(|e| !e.is_empty()) {
                let known = EXTENSIONS.contains(&extension) || extension.starts_with("RTV_");
                assert!(known, "{} of {} {}", extension, object.kind, object.subtype);
            }
        }
    }

    #[test]
    fn no_parameter_is_described_twice() {
        for object in objects() {
            let mut names: Vec<_> = object.parameters().map(|p| p.name).collect();
            names.sort_unstable();
            let all = names.len();
            names.dedup();
            assert_eq!(all, names.len(), "{} {}", object.kind, object.subtype);
        }
    }
}

//! Materials, samplers and lights.

use super::{ATTRIBUTES, COLORS, DataType, ObjectSchema, Parameter};

const IDENTITY: &[f32] =
    &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
const COLOR_INPUT: &[DataType] =
    &[DataType::FLOAT32_VEC3, DataType::SAMPLER, DataType::STRING, DataType::FLOAT32_VEC4];
const SCALAR_INPUT: &[DataType] = &[DataType::FLOAT32, DataType::SAMPLER, DataType::STRING];
const FLOAT: &[DataType] = &[DataType::FLOAT32];
const VEC3: &[DataType] = &[DataType::FLOAT32_VEC3];
const STRING: &[DataType] = &[DataType::STRING];

const OPACITY: &[Parameter] = &[
    Parameter::new(
        "opacity",
        SCALAR_INPUT,
        "1 opaque to 0 invisible; a number, attribute or sampler",
    )
    .floats(&[1.0]),
    Parameter::new(
        "alphaMode",
        STRING,
        "whether opacity and the colour's alpha count, gradually or with a threshold",
    )
    .text("opaque", &["opaque", "blend", "mask"]),
    Parameter::new("alphaCutoff", FLOAT, "threshold of the mode `mask`")
        .floats(&[0.5])
        .between(0.0, 1.0),
];

const MATTE: &[Parameter] = &[Parameter::new(
    "color",
    COLOR_INPUT,
    "diffuse reflectance: linear RGB, an attribute's name or a sampler",
)
.floats(&[0.8, 0.8, 0.8])];

const PHYSICALLY_BASED: &[Parameter] = &[
    Parameter::new("baseColor", COLOR_INPUT, "linear RGB, an attribute's name or a sampler")
        .floats(&[1.0, 1.0, 1.0]),
    Parameter::new(
        "metallic",
        SCALAR_INPUT,
        "0 dielectric to 1 metal; a number, attribute or \
                                              sampler",
    )
    .floats(&[1.0])
    .between(0.0, 1.0),
    Parameter::new("roughness", SCALAR_INPUT, "0 mirror to 1 dull; a number, attribute or sampler")
        .floats(&[1.0])
        .between(0.0, 1.0),
    Parameter::new(
        "normal",
        &[DataType::SAMPLER],
        "normals, 2 rgb - 1 in the frame of tangent, its partner and shading normal",
    ),
    Parameter::new(
        "emissive",
        COLOR_INPUT,
        "radiance given off: linear RGB, an attribute's name or a sampler",
    )
    .floats(&[0.0, 0.0, 0.0]),
    Parameter::new(
        "occlusion",
        &[DataType::SAMPLER],
        "share of ambient and reflected light that \
                                                       gets in",
    ),
    Parameter::new(
        "specular",
        SCALAR_INPUT,
        "strength of the dielectric reflection, times that of `ior`; a number, attribute or \
         sampler",
    )
    .floats(&[0.0])
    .between(0.0, 1.0),
    Parameter::new(
        "transmission",
        FLOAT,
        "1 for clear glass of index `ior`; there is nothing between 0 and 1",
    )
    .floats(&[0.0])
    .between(0.0, 1.0),
    Parameter::new("ior", FLOAT, "refractive index").floats(&[1.5]).between(1.0, 3.0),
    Parameter::new(
        "attenuationDistance",
        FLOAT,
        "distance in glass over which light takes on `attenuationColor`",
    )
    .floats(&[f32::INFINITY]),
    Parameter::new("attenuationColor", VEC3, "colour of white light after that distance")
        .floats(&[1.0, 1.0, 1.0]),
];

const IN_OUT: &[Parameter] = &[
    Parameter::new(
        "inTransform",
        &[DataType::FLOAT32_MAT4],
        "matrix on the attribute before the look-up",
    )
    .floats(IDENTITY),
    Parameter::new(
        "inOffset",
        &[DataType::FLOAT32_VEC4],
        "added to the attribute after the matrix",
    )
    .floats(&[0.0; 4]),
    Parameter::new("filter", STRING, "how texels are combined")
        .text("linear", &["nearest", "linear"]),
    Parameter::new(
        "borderColor",
        &[DataType::FLOAT32_VEC4],
        "what lies outside with clampToBorder",
    )
    .floats(&[0.0; 4])
    .of("KHR_SAMPLER_IMAGExD_CLAMP_TO_BORDER"),
];
const OUT: &[Parameter] = &[
    Parameter::new("inAttribute", STRING, "the attribute to look up")
        .text("attribute0", ATTRIBUTES),
    Parameter::new("outTransform", &[DataType::FLOAT32_MAT4], "matrix on the result")
        .floats(IDENTITY),
    Parameter::new("outOffset", &[DataType::FLOAT32_VEC4], "added to the result after the matrix")
        .floats(&[0.0; 4]),
];
const WRAP: &[&str] = &["clampToEdge", "repeat", "mirrorRepeat", "clampToBorder"];

const fn wrap(name: &'static str) -> Parameter {
    Parameter::new(name, STRING, "what lies outside of 0 to 1").text("clampToEdge", WRAP)
}

const fn image(dimensions: &'static [DataType]) -> Parameter {
    Parameter { elements: COLORS, ..Parameter::new("image", dimensions, "the texels").required() }
}

const LIGHT: &[Parameter] = &[Parameter::new("color", VEC3, "linear RGB").floats(&[1.0, 1.0, 1.0])];
const DIRECTION: Parameter =
    Parameter::new("direction", VEC3, "where the light goes").floats(&[0.0, 0.0, -1.0]);
const POSITION: Parameter =
    Parameter::new("position", VEC3, "place in the space of its group or world").floats(&[0.0; 3]);
const INTENSITY: Parameter = Parameter::new("intensity", FLOAT, "W/sr").floats(&[1.0]);
const OPENING_ANGLE: Parameter =
    Parameter::new("openingAngle", FLOAT, "full angle of the cone, radians")
        .floats(&[std::f32::consts::PI]);
const FALLOFF_ANGLE: Parameter =
    Parameter::new("falloffAngle", FLOAT, "angle between the rim and full intensity, radians")
        .floats(&[0.1]);
const POWER: Parameter =
    Parameter::new("power", FLOAT, "W in all directions; comes before `intensity`");

const fn object(
    kind: DataType,
    subtype: &'static str,
    extension: &'static str,
    about: &'static str,
    groups: &'static [&'static [Parameter]],
) -> ObjectSchema {
    ObjectSchema { kind, subtype, about, extension, groups }
}

pub(super) const OBJECTS: &[ObjectSchema] = &[
    object(DataType::MATERIAL, "matte", "KHR_MATERIAL_MATTE", "ideal diffuse", &[MATTE, OPACITY]),
    object(
        DataType::MATERIAL,
        "physicallyBased",
        "KHR_MATERIAL_PHYSICALLY_BASED",
        "metallic-roughness, or clear glass",
        &[PHYSICALLY_BASED, OPACITY],
    ),
    object(
        DataType::SAMPLER,
        "image1D",
        "KHR_SAMPLER_IMAGE1D",
        "a row of texels",
        &[&[image(&[DataType::ARRAY1D]), wrap("wrapMode")], IN_OUT, OUT],
    ),
    object(
        DataType::SAMPLER,
        "image2D",
        "KHR_SAMPLER_IMAGE2D",
        "a picture",
        &[&[image(&[DataType::ARRAY2D]), wrap("wrapMode1"), wrap("wrapMode2")], IN_OUT, OUT],
    ),
    object(
        DataType::SAMPLER,
        "image3D",
        "KHR_SAMPLER_IMAGE3D",
        "a block of texels",
        &[
            &[image(&[DataType::ARRAY3D]), wrap("wrapMode1"), wrap("wrapMode2"), wrap("wrapMode3")],
            IN_OUT,
            OUT,
        ],
    ),
    object(
        DataType::SAMPLER,
        "primitive",
        "KHR_SAMPLER_PRIMITIVE",
        "a value per primitive",
        &[&[
            Parameter::array("array", COLORS, "the values").required(),
            Parameter::new(
                "inOffset",
                &[DataType::UINT64, DataType::UINT32],
                "added to the number of the primitive",
            )
            .whole(0),
        ]],
    ),
    object(
        DataType::SAMPLER,
        "transform",
        "KHR_SAMPLER_TRANSFORM",
        "an attribute times a matrix",
        &[OUT],
    ),
    object(
        DataType::LIGHT,
        "directional",
        "KHR_LIGHT_DIRECTIONAL",
        "parallel light",
        &[
            LIGHT,
            &[
                DIRECTION,
                Parameter::new("irradiance", FLOAT, "W/m² on a surface that faces it")
                    .floats(&[1.0]),
                Parameter::new("angularDiameter", FLOAT, "size in the sky, radians").floats(&[0.0]),
                Parameter::new(
                    "radiance",
                    FLOAT,
                    "W/(sr m²); comes before `irradiance` when it has a size",
                ),
            ],
        ],
    ),
    object(
        DataType::LIGHT,
        "point",
        "KHR_LIGHT_POINT",
        "light from a point or a sphere",
        &[
            LIGHT,
            &[
                POSITION,
                INTENSITY,
                POWER,
                Parameter::new("radius", FLOAT, "radius of the sphere").floats(&[0.0]),
                Parameter::new(
                    "radiance",
                    FLOAT,
                    "W/(sr m²); comes before the others when it has a radius",
                ),
            ],
        ],
    ),
    object(
        DataType::LIGHT,
        "spot",
        "KHR_LIGHT_SPOT",
        "a cone of light",
        &[LIGHT, &[POSITION, DIRECTION, OPENING_ANGLE, FALLOFF_ANGLE, INTENSITY, POWER]],
    ),
    object(
        DataType::LIGHT,
        "quad",
        "KHR_LIGHT_QUAD",
        "a parallelogram that shines with the cosine to its normal",
        &[
            LIGHT,
            &[
                Parameter::new("position", VEC3, "a corner, in the space of its group or world")
                    .floats(&[0.0; 3]),
                Parameter::new("edge1", VEC3, "from there to a neighbouring corner")
                    .floats(&[1.0, 0.0, 0.0]),
                Parameter::new("edge2", VEC3, "from there to the other neighbouring corner")
                    .floats(&[0.0, 1.0, 0.0]),
                Parameter::new(
                    "side",
                    STRING,
                    "which side shines; the front is where edge1 x edge2 points",
                )
                .text("front", &["front", "back", "both"]),
                INTENSITY,
                POWER,
                Parameter::new("radiance", FLOAT, "W/(sr m²); comes before the others"),
            ],
        ],
    ),
    object(
        DataType::LIGHT,
        "ring",
        "KHR_LIGHT_RING",
        "a ring or disk that shines to one side, with the cosine to its normal",
        &[
            LIGHT,
            &[
                POSITION,
                DIRECTION,
                OPENING_ANGLE,
                FALLOFF_ANGLE,
                Parameter::new("radius", FLOAT, "radius of the ring").floats(&[0.0]),
                Parameter::new("innerRadius", FLOAT, "radius of its hole").floats(&[0.0]),
                INTENSITY,
                POWER,
                Parameter::new(
                    "radiance",
                    FLOAT,
                    "W/(sr m²); comes before the others when it has a radius",
                ),
            ],
        ],
    ),
    object(
        DataType::LIGHT,
        "hdri",
        "KHR_LIGHT_HDRI",
        "a picture around everything",
        &[
            LIGHT,
            &[
                Parameter::new("up", VEC3, "which way the picture's top is")
                    .floats(&[0.0, 0.0, 1.0]),
                Parameter::new("direction", VEC3, "where the picture's middle is")
                    .floats(&[1.0, 0.0, 0.0]),
                Parameter {
                    elements: &[DataType::FLOAT32_VEC3],
                    ..Parameter::new(
                        "radiance",
                        &[DataType::ARRAY2D],
                        "the picture, latitude by longitude",
                    )
                    .required()
                },
                Parameter::new("layout", STRING, "how the picture is spread")
                    .text("equirectangular", &["equirectangular"]),
                Parameter::new("scale", FLOAT, "factor on the picture").floats(&[1.0]),
            ],
        ],
    ),
];

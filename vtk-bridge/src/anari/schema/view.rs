//! Cameras, renderers, frames, arrays and the device.

use super::{DataType, ObjectSchema, Parameter};

const FLOAT: &[DataType] = &[DataType::FLOAT32];
const VEC3: &[DataType] = &[DataType::FLOAT32_VEC3];
const COUNT: &[DataType] = &[DataType::INT32, DataType::UINT32];
const FLAG: &[DataType] = &[DataType::BOOL];

const EYE: &[Parameter] = &[
    Parameter::new("position", VEC3, "place of the eye").floats(&[0.0; 3]),
    Parameter::new("direction", VEC3, "viewing direction").floats(&[0.0, 0.0, -1.0]),
    Parameter::new("up", VEC3, "which way the picture's top is").floats(&[0.0, 1.0, 0.0]),
    Parameter::new(
        "imageRegion",
        &[DataType::FLOAT32_BOX2],
        "part of the picture that fills the frame, from the lower left",
    )
    .floats(&[0.0, 0.0, 1.0, 1.0]),
];

const CAMERA: &[Parameter] = &[
    Parameter::new("aspect", FLOAT, "width over height; that of the frame when not set"),
    Parameter::new("near", FLOAT, "what is nearer than this is cut away; nothing when not set"),
    Parameter::new("far", FLOAT, "what is farther than this is cut away; nothing when not set"),
];

/// Parameters shared by both renderers.
const RENDERER: &[Parameter] = &[
    Parameter {
        elements: super::COLORS,
        ..Parameter::new(
            "background",
            &[DataType::FLOAT32_VEC4, DataType::FLOAT32_VEC3, DataType::ARRAY2D],
            "colour or picture behind everything",
        )
        .floats(&[0.0, 0.0, 0.0, 1.0])
        .of("KHR_RENDERER_BACKGROUND_COLOR")
    },
    Parameter::new("ambientColor", VEC3, "colour of light from everywhere")
        .floats(&[1.0; 3])
        .of("KHR_RENDERER_AMBIENT_LIGHT"),
    Parameter::new("ambientRadiance", FLOAT, "W/(sr m²) of light from everywhere")
        .floats(&[0.0])
        .of("KHR_RENDERER_AMBIENT_LIGHT"),
    Parameter::new("pixelSamples", COUNT, "samples per pixel").whole(1).between(1.0, 65536.0),
    Parameter::new("shadows", FLAG, "whether lights throw shadows").whole(1),
    Parameter::new("maxDepth", COUNT, "most reflections, refractions and bounces in a row")
        .whole(8)
        .between(0.0, 65535.0),
    Parameter::new("lightSamples", COUNT, "shadow rays per sample to each light with a size")
        .whole(4)
        .between(1.0, 4096.0),
    Parameter::new("volumeTolerance", FLOAT, "error allowed in volumes, in levels of 1/255")
        .floats(&[0.5])
        .between(0.000_001, 64.0),
];

const AMBIENT_OCCLUSION: &[Parameter] = &[
    Parameter::new(
        "ambientSamples",
        COUNT,
        "rays per sample that dim ambient light near surfaces; 0 for none",
    )
    .whole(0)
    .between(0.0, 4096.0),
    Parameter::new("ambientOcclusionDistance", FLOAT, "how far surfaces dim")
        .floats(&[f32::INFINITY]),
];

const fn object(
    kind: DataType,
    subtype: &'static str,
    extension: &'static str,
    about: &'static str,
    groups: &'static [&'static [Parameter]],
) -> ObjectSchema {
    ObjectSchema { kind, subtype, about, extension, groups }
}

const fn channel(
    name: &'static str,
    type_values: &'static [DataType],
    extension: &'static str,
    about: &'static str,
) -> Parameter {
    Parameter { type_values, ..Parameter::new(name, &[DataType::DATA_TYPE], about).of(extension) }
}

/// The channels of a frame.
pub(super) const CHANNELS: &[Parameter] = &[
    channel(
        "channel.color",
        &[DataType::UFIXED8_VEC4, DataType::UFIXED8_RGBA_SRGB, DataType::FLOAT32_VEC4],
        "",
        "the picture; its rows begin at the bottom",
    ),
    channel(
        "channel.depth",
        &[DataType::FLOAT32],
        "",
        "distance from the eye; infinite where nothing is",
    ),
    channel(
        "channel.normal",
        &[DataType::FIXED16_VEC3, DataType::FLOAT32_VEC3],
        "KHR_FRAME_CHANNEL_NORMAL",
        "shading normal in world axes",
    ),
    channel(
        "channel.albedo",
        &[DataType::UFIXED8_VEC3, DataType::UFIXED8_RGB_SRGB, DataType::FLOAT32_VEC3],
        "KHR_FRAME_CHANNEL_ALBEDO",
        "colour without light",
    ),
    channel(
        "channel.primitiveId",
        &[DataType::UINT32],
        "KHR_FRAME_CHANNEL_PRIMITIVE_ID",
        "number of the primitive",
    ),
    channel(
        "channel.objectId",
        &[DataType::UINT32],
        "KHR_FRAME_CHANNEL_OBJECT_ID",
        "`id` of the surface",
    ),
    channel(
        "channel.instanceId",
        &[DataType::UINT32],
        "KHR_FRAME_CHANNEL_INSTANCE_ID",
        "`id` of the instance",
    ),
];

pub(super) const OBJECTS: &[ObjectSchema] = &[
    object(
        DataType::CAMERA,
        "perspective",
        "KHR_CAMERA_PERSPECTIVE",
        "a pinhole or thin lens",
        &[
            EYE,
            CAMERA,
            &[
                Parameter::new("fovy", FLOAT, "vertical angle of view, radians")
                    .floats(&[std::f32::consts::FRAC_PI_3]),
                Parameter::new("apertureRadius", FLOAT, "radius of the lens; 0 for a pinhole")
                    .floats(&[0.0])
                    .of("KHR_CAMERA_DEPTH_OF_FIELD"),
                Parameter::new("focusDistance", FLOAT, "distance of what is sharp")
                    .floats(&[1.0])
                    .of("KHR_CAMERA_DEPTH_OF_FIELD"),
            ],
        ],
    ),
    object(
        DataType::CAMERA,
        "orthographic",
        "KHR_CAMERA_ORTHOGRAPHIC",
        "parallel projection",
        &[
            EYE,
            CAMERA,
            &[Parameter::new("height", FLOAT, "height of the picture in the world").floats(&[1.0])],
        ],
    ),
    object(
        DataType::CAMERA,
        "omnidirectional",
        "KHR_CAMERA_OMNIDIRECTIONAL",
        "a panorama: longitude by latitude",
        &[
            EYE,
            &[Parameter::new("layout", &[DataType::STRING], "how the directions are spread")
                .text("equirectangular", &["equirectangular"])],
        ],
    ),
    object(
        DataType::RENDERER,
        "default",
        "",
        "direct light, shadows, mirrors, glass and, when asked for, ambient occlusion",
        &[RENDERER, AMBIENT_OCCLUSION],
    ),
    object(DataType::RENDERER, "pathtracer", "", "light over many bounces", &[RENDERER]),
    object(
        DataType::FRAME,
        "",
        "",
        "a picture",
        &[
            &[
                Parameter::new("world", &[DataType::WORLD], "what is drawn").required(),
                Parameter::new("renderer", &[DataType::RENDERER], "how it is drawn").required(),
                Parameter::new("camera", &[DataType::CAMERA], "from where it is seen").required(),
                Parameter::new("size", &[DataType::UINT32_VEC2], "pixels per row, and rows")
                    .required(),
                Parameter::new(
                    "accumulation",
                    FLAG,
                    "frames of the same scene add to their samples",
                )
                .whole(0)
                .of("KHR_FRAME_ACCUMULATION"),
                Parameter::new(
                    "frameCompletionCallback",
                    &[DataType::FRAME_COMPLETION_CALLBACK],
                    "called after each frame",
                )
                .of("KHR_FRAME_COMPLETION_CALLBACK"),
                Parameter::new(
                    "frameCompletionCallbackUserData",
                    &[DataType::VOID_POINTER],
                    "handed to that function",
                )
                .of("KHR_FRAME_COMPLETION_CALLBACK"),
            ],
            CHANNELS,
        ],
    ),
    object(
        DataType::DEVICE,
        "default",
        "",
        "rt-core, a ray tracer for scientific visualization on the CPU",
        &[&[
            Parameter::new("statusCallback", &[DataType::STATUS_CALLBACK], "takes messages"),
            Parameter::new(
                "statusCallbackUserData",
                &[DataType::VOID_POINTER],
                "handed to that function",
            ),
        ]],
    ),
    object(
        DataType::ARRAY1D,
        "",
        "",
        "a row of elements",
        &[&[Parameter::new("region", &[DataType(2104)], "first and past-the-last element in use")
            .of("KHR_ARRAY1D_REGION")]],
    ),
    object(DataType::ARRAY2D, "", "", "rows of elements", &[]),
    object(DataType::ARRAY3D, "", "", "slices of rows of elements", &[]),
];

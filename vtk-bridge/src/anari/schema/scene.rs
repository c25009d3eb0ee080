//! Worlds, groups, instances, surfaces, volumes and fields.

use super::{COLORS, DataType, ObjectSchema, Parameter};

const VEC4: &[DataType] = &[DataType::FLOAT32_VEC4];

const CONTENT: &[Parameter] = &[
    Parameter::array("surface", &[DataType::SURFACE], "surfaces"),
    Parameter::array("volume", &[DataType::VOLUME], "volumes"),
    Parameter::array("light", &[DataType::LIGHT], "lights"),
];

const ATTRIBUTES: &[Parameter] = &[
    Parameter::new("color", VEC4, "replaces the attribute of all geometries of the group"),
    Parameter::new("attribute0", VEC4, "replaces the attribute of all geometries of the group"),
    Parameter::new("attribute1", VEC4, "replaces the attribute of all geometries of the group"),
    Parameter::new("attribute2", VEC4, "replaces the attribute of all geometries of the group"),
    Parameter::new("attribute3", VEC4, "replaces the attribute of all geometries of the group"),
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

pub(super) const OBJECTS: &[ObjectSchema] = &[
    object(
        DataType::WORLD,
        "",
        "",
        "everything that is drawn",
        &[&[Parameter::array("instance", &[DataType::INSTANCE], "placed groups")], CONTENT],
    ),
    object(
        DataType::GROUP,
        "",
        "",
        "surfaces, volumes and lights that belong together",
        &[CONTENT],
    ),
    object(
        DataType::INSTANCE,
        "transform",
        "KHR_INSTANCE_TRANSFORM",
        "a group at a place",
        &[
            &[
                Parameter::new("group", &[DataType::GROUP], "what is placed").required(),
                Parameter {
                    elements: &[DataType::FLOAT32_MAT4],
                    ..Parameter::new(
                        "transform",
                        &[DataType::FLOAT32_MAT4, DataType::ARRAY1D],
                        "object to world; an array for many copies",
                    )
                    .floats(&[
                        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0,
                        1.0,
                    ])
                },
                Parameter {
                    elements: &[DataType::UINT32],
                    ..Parameter::new(
                        "id",
                        &[DataType::UINT32, DataType::ARRAY1D],
                        "value in the channel instanceId",
                    )
                    .whole(u32::MAX)
                    .of("KHR_FRAME_CHANNEL_INSTANCE_ID")
                },
            ],
            ATTRIBUTES,
        ],
    ),
    object(
        DataType::SURFACE,
        "",
        "",
        "a geometry with a material",
        &[&[
            Parameter::new("geometry", &[DataType::GEOMETRY], "the shape").required(),
            Parameter::new("material", &[DataType::MATERIAL], "the look").required(),
            Parameter::new("visible", &[DataType::BOOL], "whether it is drawn").whole(1),
            Parameter::new("id", &[DataType::UINT32], "value in the channel objectId")
                .whole(u32::MAX)
                .of("KHR_FRAME_CHANNEL_OBJECT_ID"),
        ]],
    ),
    object(
        DataType::SPATIAL_FIELD,
        "structuredRegular",
        "KHR_SPATIAL_FIELD_STRUCTURED_REGULAR",
        "scalars on a regular grid, trilinear between",
        &[&[
            Parameter {
                elements: &[
                    DataType::UFIXED8,
                    DataType::FIXED16,
                    DataType::UFIXED16,
                    DataType::FLOAT32,
                    DataType::FLOAT64,
                ],
                ..Parameter::new("data", &[DataType::ARRAY3D], "a scalar per grid point").required()
            },
            Parameter::new("origin", &[DataType::FLOAT32_VEC3], "place of the first grid point")
                .floats(&[0.0; 3]),
            Parameter::new("spacing", &[DataType::FLOAT32_VEC3], "distance of grid points")
                .floats(&[1.0; 3]),
            Parameter::new("filter", &[DataType::STRING], "how scalars are combined, in volumes")
                .text("linear", &["linear", "nearest"]),
        ]],
    ),
    object(
        DataType::VOLUME,
        "transferFunction1D",
        "KHR_VOLUME_TRANSFER_FUNCTION1D",
        "a glowing, absorbing medium",
        &[&[
            Parameter::new("value", &[DataType::SPATIAL_FIELD], "the field").required(),
            Parameter::new(
                "valueRange",
                &[DataType::FLOAT32_BOX1, DataType::FLOAT64_BOX1],
                "scalars of the first and last colour",
            )
            .floats(&[0.0, 1.0]),
            Parameter {
                elements: COLORS,
                ..Parameter::new(
                    "color",
                    &[DataType::FLOAT32_VEC3, DataType::FLOAT32_VEC4, DataType::ARRAY1D],
                    "colours spread over the range; alpha multiplies `opacity`",
                )
                .floats(&[1.0, 1.0, 1.0])
            },
            Parameter {
                elements: &[DataType::FLOAT32],
                ..Parameter::new(
                    "opacity",
                    &[DataType::FLOAT32, DataType::ARRAY1D],
                    "opacities spread over the range",
                )
                .floats(&[1.0])
            },
            Parameter::new(
                "unitDistance",
                &[DataType::FLOAT32],
                "thickness of which a slab has these opacities",
            )
            .floats(&[1.0]),
            Parameter::new("visible", &[DataType::BOOL], "whether it is drawn").whole(1),
        ]],
    ),
];

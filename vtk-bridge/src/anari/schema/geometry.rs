//! Geometries.

use super::{COLORS, DataType, ObjectSchema, Parameter};

const VEC4: &[DataType] = &[DataType::FLOAT32_VEC4];
const NORMALS: &[DataType] = &[DataType::FLOAT32_VEC3, DataType::FIXED16_VEC3];
const TANGENTS: &[DataType] = &[
    DataType::FLOAT32_VEC4,
    DataType::FLOAT32_VEC3,
    DataType::FIXED16_VEC3,
    DataType::FIXED16_VEC4,
];
const POSITIONS: &[DataType] = &[DataType::FLOAT32_VEC3];
const RADII: &[DataType] = &[DataType::FLOAT32];
const CAPS: &[&str] = &["none", "first", "second", "both"];

const POSITION: Parameter =
    Parameter::array("vertex.position", POSITIONS, "places in object space").required();

const UNIFORM: &[Parameter] = &[
    Parameter::new(
        "color",
        VEC4,
        "colour of the whole geometry, for materials that ask for the attribute",
    ),
    Parameter::new("attribute0", VEC4, "value for the whole geometry"),
    Parameter::new("attribute1", VEC4, "value for the whole geometry"),
    Parameter::new("attribute2", VEC4, "value for the whole geometry"),
    Parameter::new("attribute3", VEC4, "value for the whole geometry"),
    Parameter::array("primitive.color", COLORS, "a colour per primitive"),
    Parameter::array("primitive.attribute0", COLORS, "a value per primitive"),
    Parameter::array("primitive.attribute1", COLORS, "a value per primitive"),
    Parameter::array("primitive.attribute2", COLORS, "a value per primitive"),
    Parameter::array("primitive.attribute3", COLORS, "a value per primitive"),
];

const VERTEX: &[Parameter] = &[
    POSITION,
    Parameter::array("vertex.color", COLORS, "a colour per vertex, interpolated"),
    Parameter::array("vertex.attribute0", COLORS, "a value per vertex, interpolated"),
    Parameter::array("vertex.attribute1", COLORS, "a value per vertex, interpolated"),
    Parameter::array("vertex.attribute2", COLORS, "a value per vertex, interpolated"),
    Parameter::array("vertex.attribute3", COLORS, "a value per vertex, interpolated"),
];

const POLYGON: &[Parameter] = &[
    Parameter::array(
        "vertex.tangent",
        TANGENTS,
        "direction in which the first coordinate of normal maps grows",
    ),
    Parameter::array("faceVarying.tangent", TANGENTS, "the same per corner of each primitive"),
    Parameter::array("vertex.normal", NORMALS, "shading normals per vertex"),
    Parameter::array("faceVarying.normal", NORMALS, "shading normals per corner of each primitive"),
    Parameter::array("faceVarying.color", COLORS, "a colour per corner of each primitive"),
    Parameter::array("faceVarying.attribute0", COLORS, "a value per corner of each primitive"),
    Parameter::array("faceVarying.attribute1", COLORS, "a value per corner of each primitive"),
    Parameter::array("faceVarying.attribute2", COLORS, "a value per corner of each primitive"),
    Parameter::array("faceVarying.attribute3", COLORS, "a value per corner of each primitive"),
];

const fn index(elements: &'static [DataType]) -> Parameter {
    Parameter::array(
        "primitive.index",
        elements,
        "vertices of each primitive; consecutive ones when not set",
    )
}

const RADIUS: Parameter =
    Parameter::new("radius", &[DataType::FLOAT32], "radius where no array gives one")
        .floats(&[1.0]);
const CAP: Parameter =
    Parameter::new("caps", &[DataType::STRING], "which ends are closed").text("none", CAPS);
const VERTEX_CAP: Parameter =
    Parameter::array("vertex.cap", &[DataType::UINT8], "1 to close the end at a vertex");

const fn geometry(
    subtype: &'static str,
    extension: &'static str,
    about: &'static str,
    groups: &'static [&'static [Parameter]],
) -> ObjectSchema {
    ObjectSchema { kind: DataType::GEOMETRY, subtype, about, extension, groups }
}

pub(super) const OBJECTS: &[ObjectSchema] = &[
    geometry(
        "triangle",
        "KHR_GEOMETRY_TRIANGLE",
        "triangles",
        &[UNIFORM, VERTEX, POLYGON, &[index(&[DataType::UINT32_VEC3, DataType::UINT64_VEC3])]],
    ),
    geometry(
        "quad",
        "KHR_GEOMETRY_QUAD",
        "quadrangles, drawn as two triangles each",
        &[UNIFORM, VERTEX, POLYGON, &[index(&[DataType::UINT32_VEC4, DataType::UINT64_VEC4])]],
    ),
    geometry(
        "sphere",
        "KHR_GEOMETRY_SPHERE",
        "spheres, exact",
        &[
            UNIFORM,
            VERTEX,
            &[
                index(&[DataType::UINT32, DataType::UINT64]),
                RADIUS,
                Parameter::array("vertex.radius", RADII, "a radius per vertex"),
            ],
        ],
    ),
    geometry(
        "cylinder",
        "KHR_GEOMETRY_CYLINDER",
        "cylinders, exact",
        &[
            UNIFORM,
            VERTEX,
            &[
                index(&[DataType::UINT32_VEC2, DataType::UINT64_VEC2]),
                RADIUS,
                Parameter::array("primitive.radius", RADII, "a radius per cylinder"),
                CAP,
                VERTEX_CAP,
            ],
        ],
    ),
    geometry(
        "cone",
        "KHR_GEOMETRY_CONE",
        "truncated cones, exact",
        &[
            UNIFORM,
            VERTEX,
            &[
                index(&[DataType::UINT32_VEC2, DataType::UINT64_VEC2]),
                Parameter::array("vertex.radius", RADII, "a radius per vertex; 1 when not set"),
                CAP,
                VERTEX_CAP,
            ],
        ],
    ),
    geometry(
        "curve",
        "KHR_GEOMETRY_CURVE",
        "straight segments with round joints and ends, exact",
        &[
            UNIFORM,
            VERTEX,
            &[
                Parameter::array(
                    "primitive.index",
                    &[DataType::UINT32, DataType::UINT64],
                    "first vertex of each segment; the second is the next one. One chain when not \
                     set",
                ),
                RADIUS,
                Parameter::array("vertex.radius", RADII, "a radius per vertex"),
            ],
        ],
    ),
    geometry(
        "isosurface",
        "KHR_GEOMETRY_ISOSURFACE",
        "surfaces of a field's trilinear interpolant, without triangles",
        &[
            UNIFORM,
            &[
                Parameter {
                    elements: &[DataType::FLOAT32],
                    ..Parameter::new(
                        "isovalue",
                        &[DataType::FLOAT32, DataType::ARRAY1D],
                        "one value, or several",
                    )
                    .required()
                },
                Parameter::new("field", &[DataType::SPATIAL_FIELD], "the field").required(),
            ],
        ],
    ),
];

//! Every reason has facts for which it is given.

use super::super::facts::*;
use super::super::types::*;
use super::volume::SLICE_BLEND;
use super::*;
use std::collections::BTreeSet;
use std::ptr::null;

const NO_RADII: Radii = Radii { point: 0.0, line: 0.0 };
const NO_CELLS: CellArray<'_> = CellArray { number_type: "", class: "" };

/// A white actor of polygons.
const ACTOR: RtvActorFacts = RtvActorFacts {
    actor_class: null(),
    mapper_class: null(),
    representation: RTV_SURFACE,
    pbr: 0,
    edge_visibility: 0,
    lines_as_tubes: 0,
    vertex_visibility: 0,
    translucent: 0,
    num_clipping_planes: 0,
    has_back: 0,
    back_opacity: 1.0,
    edge_opacity: 1.0,
    coat_strength: 0.0,
    anisotropy: 0.0,
    metallic: 0.0,
    edge_tint: [1.0; 3],
    shader_code: 0,
    glyphs: 0,
    texture: 0,
    num_textures: 0,
    albedo: 0,
    material: 0,
    normal: 0,
    emissive: 0,
    no_data: 0,
    block_scalars: 0,
    polygon_offset: 0,
    image_lighting: 0,
};

const SURFACE: RtvSurfaceFacts = RtvSurfaceFacts {
    num_verts: 0,
    num_lines: 0,
    representation: RTV_SURFACE,
    not_polygons: 0,
    triangulated: 0,
    edges: 0,
    texture: 0,
    maps: 0,
    has_back: 0,
    color_source: RTV_COLOR_PROPERTY,
    invalid_arrays: 0,
    unreadable_cells: 0,
    cell_components: 0,
    reserved: 0,
    cell_type: null(),
    cell_array_class: null(),
};

/// Ten arrows with colours.
const GLYPHS: RtvGlyphFacts = RtvGlyphFacts {
    source_table_tree: 0,
    num_clipping_planes: 0,
    num_sources: 1,
    data_set: 1,
    composite: 0,
    block_attributes: 0,
    num_blocks_without_points: 0,
    has_source: 1,
    num_source_polygons: 20,
    num_other_source_cells: 0,
    has_colors: 1,
    color_components: 4,
    num_colors: 10,
    num_points: 10,
};

/// A shaded image under a headlight.
const VOLUME: RtvVolumeFacts = RtvVolumeFacts {
    volume_class: null(),
    mapper_class: null(),
    cropping: 0,
    num_clipping_planes: 0,
    mask: 0,
    scattering: 0,
    vectors: 0,
    transfer_function_2d: 0,
    labels: 0,
    blend_mode: RTV_BLEND_COMPOSITE,
    gradient_opacity: 0,
    shade: 1,
    num_lights: 1,
    num_positional_lights: 0,
    num_ambient_lights: 0,
    num_listed_lights: 0,
    specular: 0.5,
    has_data: 1,
    image: 1,
    num_blocks: 0,
    dims: [2, 3, 4],
    blanked: 0,
    scalars: 1,
    cell_scalars: 0,
    num_components: 1,
    turned: 0,
    cropping_regions: 1 << 13,
    range: [0.0, 1.0],
    average_range: [-1e30, 1e30],
};

fn of_actor(f: &RtvActorFacts) -> Option<&'static str> {
    actor(f, "vtkOpenGLActor", "vtkOpenGLPolyDataMapper", NO_RADII)
}

fn of_volume(f: &RtvVolumeFacts) -> Option<&'static str> {
    volume(f, "vtkVolume", "vtkSmartVolumeMapper")
}

fn of_surface(f: &RtvSurfaceFacts) -> Option<String> {
    surface(f, NO_CELLS, NO_RADII)
}

/// What is said of the eligible facts with one change, and the reason it should be.
struct Rows(Vec<(String, &'static str)>);

impl Rows {
    fn actor(&mut self, change: impl Fn(&mut RtvActorFacts), reason: &'static str) {
        let mut facts = ACTOR;
        change(&mut facts);
        self.0.push((of_actor(&facts).unwrap_or("none").to_owned(), reason));
    }

    fn surface(&mut self, change: impl Fn(&mut RtvSurfaceFacts), reason: &'static str) {
        let mut facts = SURFACE;
        change(&mut facts);
        self.0.push((of_surface(&facts).unwrap_or("none".to_owned()), reason));
    }

    fn glyphs(&mut self, change: impl Fn(&mut RtvGlyphFacts), reason: &'static str) {
        let mut facts = GLYPHS;
        change(&mut facts);
        self.0.push((glyphs(&facts).unwrap_or("none").to_owned(), reason));
    }

    fn volume(&mut self, change: impl Fn(&mut RtvVolumeFacts), reason: &'static str) {
        let mut facts = VOLUME;
        change(&mut facts);
        self.0.push((of_volume(&facts).unwrap_or("none").to_owned(), reason));
    }
}

fn actor_rows(r: &mut Rows) {
    r.actor(
        |f| f.representation = RTV_WIREFRAME,
        "wireframe (set RTV_LINE_RADIUS to trace edges as tubes)",
    );
    r.actor(
        |f| f.representation = RTV_POINTS,
        "points (set RTV_POINT_RADIUS to trace them as spheres)",
    );
    r.actor(
        |f| (f.edge_visibility, f.lines_as_tubes) = (1, 1),
        "edges as shaded tubes on the surface",
    );
    r.actor(|f| (f.edge_visibility, f.edge_opacity) = (1, 0.5), "translucent edges on the surface");
    r.actor(|f| (f.edge_visibility, f.translucent) = (1, 1), "edges on a translucent surface");
    r.actor(|f| (f.edge_visibility, f.num_clipping_planes) = (1, 2), "edges on a clipped surface");
    r.actor(|f| f.vertex_visibility = 1, "vertices on the surface");
    let translucent_back = "translucent backs with a property of their own";
    r.actor(|f| (f.has_back, f.back_opacity) = (1, 0.5), translucent_back);
    r.actor(|f| (f.has_back, f.translucent) = (1, 1), translucent_back);
    r.actor(|f| (f.has_back, f.glyphs) = (1, 1), "glyphs whose backs have a property of their own");
    r.actor(
        |f| (f.pbr, f.image_lighting) = (1, 1),
        "a physically based surface that an image lights",
    );
    r.actor(|f| (f.pbr, f.coat_strength) = (1, 0.1), "a clear coat or anisotropy");
    r.actor(|f| (f.pbr, f.anisotropy) = (1, -0.1), "a clear coat or anisotropy");
    r.actor(
        |f| (f.pbr, f.metallic, f.edge_tint) = (1, 0.5, [1.0, 1.0, 0.9]),
        "a metal with an edge tint",
    );
    r.actor(
        |f| (f.pbr, f.num_textures, f.albedo) = (1, 2, RTV_TEXTURE),
        "textures of the property for coats or anisotropy, or of a program's own shader",
    );
    r.actor(
        |f| (f.pbr, f.num_textures, f.normal, f.glyphs) = (1, 1, RTV_TEXTURE, 1),
        "glyphs with textures of the property other than its base colour",
    );
    r.actor(
        |f| (f.pbr, f.num_textures, f.albedo, f.texture) = (1, 1, RTV_TEXTURE, RTV_TEXTURE),
        "a texture and a texture of the property",
    );
    r.actor(
        |f| (f.num_textures, f.material) = (1, RTV_TEXTURE),
        "textures of the property without physically based shading",
    );
    let moved = RTV_TEXTURE | RTV_TEXTURE_TRANSFORM;
    let cube = RTV_TEXTURE | RTV_TEXTURE_CUBE_MAP;
    r.actor(|f| (f.pbr, f.num_textures, f.emissive) = (1, 1, moved), "a texture with a transform");
    r.actor(|f| f.texture = moved, "a texture with a transform");
    r.actor(|f| f.texture = cube, "a cube map");
    let smaller = RTV_TEXTURE | RTV_TEXTURE_MIPMAP;
    r.actor(|f| f.texture = smaller, "a texture with mipmaps");
    let one_sided = RTV_TEXTURE | RTV_TEXTURE_FRONT_ONLY;
    r.actor(|f| f.texture = one_sided, "a texture that back faces do not show");
    r.actor(|f| f.block_scalars = 1, "blocks with scalars, colour maps or textures of their own");
    r.actor(|f| f.shader_code = 1, "shader code of its own");
    r.actor(|f| f.no_data = 1, "no data");
    let with_classes = |actor_class: &str, mapper_class: &str| {
        actor(&ACTOR, actor_class, mapper_class, NO_RADII).unwrap_or("none").to_owned()
    };
    let of_class = "OpenGL draws props of this class";
    r.0.push((with_classes("vtkFollower", "vtkPolyDataMapper"), of_class));
    r.0.push((with_classes("vtkActor", ""), of_class));
    let of_mapper = "OpenGL draws mappers of this class";
    r.0.push((with_classes("vtkActor", "vtkMoleculeMapper"), of_mapper));
}

fn surface_rows(r: &mut Rows) {
    r.surface(|f| f.not_polygons = 1, "its data are not polygons");
    r.surface(
        |f| f.num_verts = 1,
        "it has vertices (set RTV_POINT_RADIUS to trace them as spheres)",
    );
    r.surface(|f| f.num_lines = 1, "it has lines (set RTV_LINE_RADIUS to trace them as tubes)");
    r.surface(|f| (f.triangulated, f.edges) = (1, 1), "edges of polygons that are not convex");
    r.surface(
        |f| (f.texture, f.has_back) = (1, 1),
        "a texture on a surface whose backs have a property of their own",
    );
    r.surface(|f| (f.texture, f.color_source) = (1, 2), "it has a texture and colours");
    r.surface(
        |f| (f.maps, f.has_back) = (1, 1),
        "textures of the property on a surface whose backs have a property of their own",
    );
    r.surface(|f| f.invalid_arrays = 1, "its arrays do not fit together (a warning names them)");
    r.surface(|f| f.unreadable_cells = 1, "its cells are numbered by no array");
    let pairs = CellArray { number_type: "int", class: "vtkIntArray" };
    let facts = RtvSurfaceFacts { unreadable_cells: 1, cell_components: 2, ..SURFACE };
    r.0.push((
        surface(&facts, pairs, NO_RADII).unwrap_or_default(),
        "its cells are numbered by 2 x int of vtkIntArray",
    ));
}

fn glyph_rows(r: &mut Rows) {
    r.glyphs(|f| f.source_table_tree = 1, "glyphs from a tree of sources");
    r.glyphs(|f| f.num_clipping_planes = 1, "glyphs with clipping planes");
    r.glyphs(|f| f.num_sources = 0, "glyphs without a source");
    let source = "glyphs whose source is not polygons";
    r.glyphs(|f| f.num_source_polygons = 0, source);
    r.glyphs(|f| f.num_other_source_cells = 1, source);
    let blocks = "glyphs on blocks with colours or visibility of their own";
    r.glyphs(|f| f.data_set = 0, blocks);
    r.glyphs(|f| (f.data_set, f.composite, f.block_attributes) = (0, 1, 1), blocks);
    r.glyphs(
        |f| (f.data_set, f.composite, f.num_blocks_without_points) = (0, 1, 1),
        "glyphs on data without points",
    );
    let colors = "glyphs with colours that are not of points";
    r.glyphs(|f| f.num_colors = 1, colors);
    r.glyphs(|f| f.color_components = 3, colors);
}

fn volume_rows(r: &mut Rows) {
    r.volume(
        |f| (f.cropping, f.cropping_regions, f.blend_mode) = (1, 7, RTV_BLEND_ADDITIVE),
        "a volume cropped to more than a box, with another blending than composite",
    );
    r.volume(|f| (f.cropping, f.cropping_regions) = (1, 0), "a volume cropped to no region");
    r.volume(|f| (f.cropping, f.turned) = (1, 1), "a cropped volume with turned axes");
    r.volume(|f| f.mask = 1, "a volume with a mask");
    r.volume(|f| f.scattering = 1, "a volume with shadows or scattering of its own");
    r.volume(|f| f.vectors = 1, "a volume of vectors");
    r.volume(|f| f.transfer_function_2d = 1, "a volume with a two-dimensional transfer function");
    r.volume(|f| f.labels = 1, "a volume with labels");
    r.volume(|f| f.blend_mode = SLICE_BLEND, "a volume with slice blending");
    r.volume(|f| f.blend_mode = 7, "a volume with a blend mode that is not known");
    r.volume(
        |f| (f.blend_mode, f.gradient_opacity) = (RTV_BLEND_ISOSURFACES, 1),
        "a volume with gradient opacity and another blending than composite",
    );
    r.volume(
        |f| f.blend_mode = RTV_BLEND_MINIMUM,
        "a shaded volume with maximum or minimum intensity blending",
    );
    r.volume(|f| f.num_lights = 0, "a shaded volume without a light");
    r.volume(|f| f.num_positional_lights = 1, "a shaded volume under lights that have a place");
    r.volume(|f| f.num_ambient_lights = 1, "a shaded volume under lights with an ambient colour");
    r.volume(|f| f.num_lights = 7, "a shaded volume under more than six lights");
    r.volume(
        |f| f.num_listed_lights = 1,
        "a shaded volume with a highlight under other lights than one white headlight",
    );
    r.volume(|f| (f.image, f.num_blocks) = (0, 2), "a volume of several blocks");
    r.volume(|f| f.image = 0, "a volume that is not image data");
    r.volume(|f| f.dims[1] = 1, "a volume one point thick");
    r.volume(|f| f.blanked = 1, "a volume with blanked parts");
    r.volume(|f| f.scalars = 0, "a volume without scalars");
    r.volume(|f| f.num_components = 3, "a volume of several components");
    r.volume(
        |f| (f.blend_mode, f.average_range) = (RTV_BLEND_AVERAGE, [0.1, 2.0]),
        "a volume with average intensity blending of a part of its scalars",
    );
    let with_classes = |volume_class: &str, mapper_class: &str| {
        volume(&VOLUME, volume_class, mapper_class).unwrap_or("none").to_owned()
    };
    let (of_class, of_mapper) =
        ("OpenGL draws volumes of this class", "OpenGL draws volume mappers of this class");
    r.0.push((with_classes("vtkMultiVolume", "vtkSmartVolumeMapper"), of_class));
    r.0.push((with_classes("vtkVolume", ""), of_mapper));
    let of_fixed_point = |change: &dyn Fn(&mut RtvVolumeFacts)| {
        let mut facts = VOLUME;
        change(&mut facts);
        let reason = volume(&facts, "vtkVolume", "vtkFixedPointVolumeRayCastMapper");
        reason.unwrap_or("none").to_owned()
    };
    r.0.push((
        of_fixed_point(&|f| f.cell_scalars = 1),
        "a volume of cells' values, which its mapper refuses",
    ));
    r.0.push((
        of_fixed_point(&|f| f.cropping = 1),
        "a volume that is cropped by vtkFixedPointVolumeRayCastMapper",
    ));
}

/// The reasons in the sources: texts of several words outside comments.
fn reasons_of_the_source() -> BTreeSet<&'static str> {
    let sources = [
        include_str!("actor.rs"),
        include_str!("glyphs.rs"),
        include_str!("surface.rs"),
        include_str!("volume.rs"),
    ];
    let lines = sources.iter().flat_map(|source| source.lines());
    let code = lines.filter(|line| !line.trim_start().starts_with("//"));
    let texts = code.flat_map(|line| line.split('"').skip(1).step_by(2));
    texts.filter(|text| text.contains(' ') && !text.contains('{')).collect()
}

#[test]
fn every_reason_is_given_for_its_facts() {
    let mut rows = Rows(Vec::new());
    actor_rows(&mut rows);
    surface_rows(&mut rows);
    glyph_rows(&mut rows);
    volume_rows(&mut rows);
    for (found, expected) in &rows.0 {
        assert_eq!(found, expected);
    }
    let tested: BTreeSet<&str> = rows.0.iter().map(|(_, expected)| *expected).collect();
    let source = reasons_of_the_source();
    assert!(source.len() > 50, "{} reasons were found", source.len());
    // The end of a reason that is put together.
    let missing: Vec<_> = source
        .difference(&tested)
        .filter(|text| !tested.iter().any(|reason| reason.ends_with(**text)))
        .collect();
    assert_eq!(missing, Vec::<&&str>::new(), "reasons without a row");
}

#[test]
fn what_nothing_speaks_against_is_traced() {
    assert_eq!(of_actor(&ACTOR), None);
    assert_eq!(of_surface(&SURFACE), None);
    assert_eq!(glyphs(&GLYPHS), None);
    assert_eq!(of_volume(&VOLUME), None);
    let (all, radii) = (RTV_TEXTURE, Radii { point: 0.1, line: 0.1 });
    let maps = RtvActorFacts {
        pbr: 1,
        metallic: 1.0,
        num_textures: 4,
        albedo: all,
        material: all,
        normal: all,
        emissive: all,
        ..ACTOR
    };
    assert_eq!(of_actor(&maps), None);
    for representation in [RTV_POINTS, RTV_WIREFRAME] {
        let facts = RtvActorFacts { representation, edge_visibility: 1, ..ACTOR };
        assert_eq!(actor(&facts, "vtkActor", "vtkDataSetMapper", radii), None);
    }
    let cells = RtvSurfaceFacts { num_verts: 3, num_lines: 3, ..SURFACE };
    assert_eq!(surface(&cells, NO_CELLS, radii), None);
    assert_eq!(of_surface(&RtvSurfaceFacts { representation: RTV_POINTS, ..cells }), None);
    // Unshaded volumes show no light.
    let dark = RtvVolumeFacts { shade: 0, num_lights: 9, num_listed_lights: 9, ..VOLUME };
    assert_eq!(of_volume(&dark), None);
    // What is asked before the data are there.
    assert_eq!(of_volume(&RtvVolumeFacts { has_data: 0, image: 0, ..VOLUME }), None);
    assert_eq!(glyphs(&RtvGlyphFacts { has_source: 0, has_colors: 0, ..GLYPHS }), None);
}

#[test]
fn the_first_of_several_reasons_is_given() {
    let facts = RtvActorFacts { shader_code: 1, vertex_visibility: 1, no_data: 1, ..ACTOR };
    assert_eq!(of_actor(&facts), Some("vertices on the surface"));
    let facts = RtvVolumeFacts { mask: 1, image: 0, ..VOLUME };
    assert_eq!(of_volume(&facts), Some("a volume with a mask"));
}

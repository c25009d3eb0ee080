//! Draw calls become meshes with attributes: immediate mode, vertex arrays, display lists and
//! evaluators, and the caches that recognise geometry and attributes of earlier frames.

mod array_element;
pub(crate) mod attribute_cache;
mod batch;
pub(crate) mod buffer_writes;
pub(crate) mod display_lists;
pub(crate) mod draw;
pub(crate) mod evaluators;
pub(crate) mod geometry_cache;
pub(crate) mod immediate_mode;
pub(crate) mod primitives;
mod textures;
pub(crate) mod vertex_arrays;
pub(crate) mod vertex_recorder;
pub(crate) mod vertex_selection;

use attribute_cache::AttributeCache;
use display_lists::ListRecording;
use evaluators::Evaluators;
use geometry_cache::GeometryCache;
use textures::TextureCache;
use vertex_arrays::VertexArrays;
use vertex_recorder::VertexRecorder;

/// Where the calls of immediate mode go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum ImmediateModeTarget {
    /// Not between Begin and End.
    #[default]
    Outside,
    /// Between Begin and End of a traced primitive.
    Trace,
    /// Between Begin and End of a primitive that the driver draws.
    Pass,
    /// Into a display list.
    List,
}

/// What a context captures, and the caches that recognise it.
#[derive(Default)]
pub(crate) struct Capture {
    pub(crate) immediate_target: ImmediateModeTarget,
    pub(crate) recorder: VertexRecorder,
    pub(crate) evaluators: Evaluators,
    /// The arrays from which `glArrayElement` takes the vertices of the open primitive.
    pub(crate) element_arrays: Option<VertexArrays>,
    /// The display list that is being compiled.
    pub(crate) recording: Option<ListRecording>,
    /// The depth of nested calls of lists.
    pub(crate) depth_of_lists: u32,
    pub(crate) geometry_cache: GeometryCache,
    pub(crate) attribute_cache: AttributeCache,
    pub(crate) textures: TextureCache,
}

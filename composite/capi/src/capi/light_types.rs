//! Structures and constants of photographs; the rules are those of `types.rs`.

/// A gas on a lattice of points, without its densities. All ranks give the same.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeGas {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// Points per axis of the whole lattice.
    pub dims: [u32; 3],
    /// Not used; 0.
    pub reserved: u32,
    /// Position of the first point, metres.
    pub origin_m: [f64; 3],
    /// Distance of neighbouring points, metres.
    pub spacing_m: [f64; 3],
    /// K of the law of Gladstone and Dale, n = 1 + K rho, m^3/kg: 2.26e-4 for air.
    pub gladstone_dale: f64,
    /// Density of the gas outside, kg/m^3.
    pub reference_density: f64,
}

/// A schlieren picture: a slit, and a knife's edge in the cut-off plane.
pub const RTSV_COMPOSITE_KNIFE: u32 = 0;
/// A shadowgraph: no cut-off, and a film that is focused on a plane.
pub const RTSV_COMPOSITE_SHADOWGRAPH: u32 = 1;
/// Gradients by central differences: needs one more layer of points around a brick's cells.
pub const RTSV_COMPOSITE_TRILINEAR_GRADIENT: u32 = 0;
/// The gradient of linear interpolation, which jumps from cell to cell: needs no more layers.
pub const RTSV_COMPOSITE_TRILINEAR: u32 = 1;

/// How a gas is photographed; the same on all ranks but for timeout_secs and threads.
/// rtsv_composite_shot_init fills it: schlieren along z, 512 x 512 pixels that show the whole gas.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeShot {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RTSV_COMPOSITE_KNIFE or RTSV_COMPOSITE_SHADOWGRAPH.
    pub technique: u32,
    /// RTSV_COMPOSITE_TRILINEAR_GRADIENT (the default) or RTSV_COMPOSITE_TRILINEAR.
    pub interpolant: u32,
    /// The rank that gets the picture (0).
    pub root: u32,
    /// 0 (the default) or 1: use all processors that the process may, not one thread for a rank.
    pub threads: u32,
    /// Direction of the light, towards the film.
    pub direction: [f64; 3],
    /// What is up in the picture.
    pub up: [f64; 3],
    /// Side of a pixel in the gas, metres; 0 (the default) for pixels that show the whole gas.
    pub pixel_m: f64,
    /// Longest step of a ray, in distances of points (1).
    pub step_voxels: f64,
    /// Knife: deflections in this direction brighten the picture, degrees counter-clockwise from
    /// its right (0).
    pub angle_deg: f64,
    /// Knife: width of the slit, across the edge (0.001).
    pub slit_width_m: f64,
    /// Knife: focal length of both lenses (1.5).
    pub focal_length_m: f64,
    /// Knife: fraction of the slit's image that is left open, the brightness without gas (0.5).
    pub open_fraction: f64,
    /// Shadowgraph: distance of the plane in focus from the centre of the gas, along the light.
    pub focus_m: f64,
    /// Longest wait for a rank that gives no sign of life, seconds (60).
    pub timeout_secs: f64,
}

/// A photograph. Rows start at the top.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositePhotograph {
    /// Size of this structure; set it before the call.
    pub struct_bytes: u64,
    /// Memory of the program for a float per pixel, which the call fills on the root: 1 for all
    /// light of the slit. Set it before the call; not used on other ranks.
    pub grey: *mut f32,
    /// Floats that fit there; set it before the call.
    pub grey_count: u64,
    /// Rays that this rank sent to others.
    pub rays_sent: u64,
    /// Rays that ended at a density that is no finite number; on the root.
    pub masked: u64,
    /// Rays that were turned back; on the root.
    pub turned: u64,
    /// Bytes that this rank sent.
    pub bytes_sent: u64,
    /// Rounds of rays that went from brick to brick.
    pub rounds: u32,
    /// Copies of the densities that this rank made: none.
    pub copies: u32,
}

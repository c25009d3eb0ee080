//! The numbers of a frame for its shaders.

use crate::film::Framing;
use crate::march::Frame;
use crate::optics::{Optics, SourceImage};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// `Frame` of frame.wgsl, which explains the members.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FrameParams {
    centre: [f32; 3],
    pub(super) width: u32,
    centre_low: [f32; 3],
    pub(super) height: u32,
    right_steps: [f32; 3],
    margin: u32,
    right_steps_low: [f32; 3],
    pub(super) parts: u32,
    up_steps: [f32; 3],
    pub(super) first: u32,
    up_steps_low: [f32; 3],
    pub(super) first_pass: u32,
    forward_steps: [f32; 3],
    pub(super) per_row: u32,
    forward_steps_low: [f32; 3],
    pub(super) per_pass: u32,
    right: [f32; 3],
    pub(super) counts: u32,
    up: [f32; 3],
    pub(super) outcomes: u32,
    forward: [f32; 3],
    mirror: f32,
    spacing: [f32; 3],
    unit_m: f32,
    pixel_m: [f32; 2],
    left_m: [f32; 2],
    top_m: [f32; 2],
    step_voxels: [f32; 2],
    pub(super) seed: [u32; 2],
    per_pixel_m: f32,
    n0: f32,
    focus_m: f32,
    schlieren_focal_length_m: f32,
    source_half_m: [f32; 2],
    source_axis: [f32; 2],
    pub(super) dots_seed: u32,
    pub(super) per_photon: f32,
    pub(super) per_photon_of_film: [f32; 2],
    pub(super) first_photon: u32,
    pub(super) nearest: u32,
    pub(super) technique: [[f32; 4]; 4],
}

/// High and low part of a number: 48 bits of it.
pub(super) fn parts(value: f64) -> [f32; 2] {
    let high = value as f32;
    [high, (value - f64::from(high)) as f32]
}

fn vector_parts(v: DVec3) -> [[f32; 3]; 2] {
    let all = v.to_array().map(parts);
    [all.map(|p| p[0]), all.map(|p| p[1])]
}

impl FrameParams {
    /// The numbers of the geometry. With `mirrored` the march's right is the image's left.
    pub(super) fn new(
        march: &Frame,
        framing: &Framing,
        optics: &Optics,
        n0: f64,
        step_voxels: f64,
        margin_px: u32,
        mirrored: bool,
    ) -> FrameParams {
        let mut p = FrameParams::zeroed();
        let view = &march.view;
        [p.centre, p.centre_low] = vector_parts(march.centre);
        [p.right_steps, p.right_steps_low] = vector_parts(view.right / march.spacing_m);
        [p.up_steps, p.up_steps_low] = vector_parts(view.up / march.spacing_m);
        [p.forward_steps, p.forward_steps_low] = vector_parts(view.forward / march.spacing_m);
        (p.width, p.height, p.margin) = (framing.width, framing.height, margin_px);
        (p.right, p.up) = (view.right.as_vec3().to_array(), view.up.as_vec3().to_array());
        p.forward = view.forward.as_vec3().to_array();
        p.mirror = if mirrored { -1.0 } else { 1.0 };
        p.spacing = (march.spacing_m / march.unit_m).as_vec3().to_array();
        p.unit_m = march.unit_m as f32;
        p.pixel_m = parts(framing.pixel_m);
        p.left_m = parts(framing.plane_from_pixel(0.0, 0.0)[0]);
        p.top_m = parts(framing.plane_from_pixel(0.0, 0.0)[1]);
        p.step_voxels = parts(step_voxels);
        p.per_pixel_m = (1.0 / framing.pixel_m) as f32;
        p.n0 = n0 as f32;
        p.focus_m = optics.focus_m as f32;
        p.schlieren_focal_length_m = optics.schlieren_focal_length_m as f32;
        match optics.source_image() {
            SourceImage::Point => {}
            SourceImage::Rectangle { half_m, axis } => {
                p.source_half_m = half_m.map(|h| h as f32);
                p.source_axis = axis.map(|a| a as f32);
            }
            SourceImage::Disc { radius_m } => p.source_half_m = [radius_m as f32, 0.0],
        }
        p
    }
}

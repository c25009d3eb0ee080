// The numbers of a frame: `FrameParams` of params.rs.

struct Frame {
    // Centre of the view in lattice coordinates, as high and low parts.
    centre: vec3f,
    // Width and height of the image in pixels.
    width: u32,
    centre_low: vec3f,
    height: u32,
    // Lattice steps per metre along the view's axes, as high and low parts.
    right_steps: vec3f,
    // Pixels around the image that also send light.
    margin: u32,
    right_steps_low: vec3f,
    // Photons: films that passes expose in turn. Beams: cells per side of a pixel.
    parts: u32,
    up_steps: vec3f,
    // First tile of this submission, or first row of cells.
    first: u32,
    up_steps_low: vec3f,
    // Photons: first pass of this submission.
    first_pass: u32,
    forward_steps: vec3f,
    // Photons: tiles of 16 x 4 pixels in a row, and in a pass. Beams: corners in a row, and rows of
    // cells in this submission.
    per_row: u32,
    forward_steps_low: vec3f,
    per_pass: u32,
    // The view's axes.
    right: vec3f,
    // First word of the counts of photons in `film`.
    counts: u32,
    up: vec3f,
    // First word of the outcomes in `film`.
    outcomes: u32,
    forward: vec3f,
    // -1 where rays go against the light, whose frame has the other right.
    mirror: f32,
    // A lattice step in units of the march.
    spacing: vec3f,
    // That unit.
    unit_m: f32,
    // All as high and low parts: side of a pixel; left and top of the image; longest step.
    pixel_m: vec2f,
    left_m: vec2f,
    top_m: vec2f,
    step_voxels: vec2f,
    seed: vec2u,
    per_pixel_m: f32,
    n0: f32,
    focus_m: f32,
    schlieren_focal_length_m: f32,
    // Extent of the source image: a radius, or half its sides and the axis of the first.
    source_half_m: vec2f,
    source_axis: vec2f,
    // Seed of the dots of a background.
    dots_seed: u32,
    // One over the photons that the undisturbed beam leaves in a pixel.
    per_photon: f32,
    // The same of the two films of a picture with noise.
    per_photon_of_film: vec2f,
    // Of photons that are kept: the first of this submission, and how many the cone filter takes.
    first_photon: u32,
    nearest: u32,
    // Numbers of the technique.
    technique: array<vec4f, 4>,
}

@group(1) @binding(0) var<uniform> frame: Frame;

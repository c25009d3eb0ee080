//! Homogeneous slabs, and the sum that a ray has collected from those it has passed.

use super::VolumeQuality;

/// A homogeneous slab: optical thickness, and colour (not multiplied by its opacity).
#[derive(Debug, Clone, Copy)]
pub(super) struct Layer {
    pub(super) tau: f64,
    pub(super) color: [f64; 3],
}

impl Layer {
    pub(super) const NOTHING: Layer = Layer { tau: 0.0, color: [0.0; 3] };

    #[inline]
    pub(super) fn opacity(&self) -> f64 {
        -(-self.tau).exp_m1()
    }

    /// Premultiplied colour and opacity.
    #[inline]
    pub(super) fn rgba(&self) -> [f64; 4] {
        let a = self.opacity();
        [self.color[0] * a, self.color[1] * a, self.color[2] * a, a]
    }

    /// Premultiplied colour and opacity of this slab in front of another.
    #[inline]
    pub(super) fn then(&self, behind: &Layer) -> [f64; 4] {
        let (f, b) = (self.rgba(), behind.rgba());
        std::array::from_fn(|c| f[c] + (1.0 - f[3]) * b[c])
    }

    /// Largest difference of a component.
    #[inline]
    pub(super) fn difference(&self, rgba: &[f64; 4]) -> f64 {
        let own = self.rgba();
        (0..4).map(|c| (own[c] - rgba[c]).abs()).fold(0.0, f64::max)
    }
}

/// What a segment of a ray emits towards the viewer, and how much light passes through it.
pub(super) struct SegmentLight {
    pub(super) t: [f64; 2],
    /// Emission that leaves the segment.
    pub(super) color: [f64; 3],
    /// Share of the light behind that passes.
    pub(super) attenuation: f64,
    /// Optical thickness, and extinction at both ends.
    pub(super) tau: f64,
    pub(super) ends: [f64; 2],
}

/// Tolerance from which the simplified transfer function is used, in levels. It is off by a
/// tenth of a level at most, so a fifth of the tolerance.
const SIMPLIFIED_FROM: f32 = 0.5;

/// State of a ray during the march.
pub(super) struct MarchState {
    pub(super) color: [f64; 3],
    pub(super) transmittance: f64,
    pub(super) depth: f64,
    pub(super) samples: u32,
    pub(super) quality: VolumeQuality,
    pub(super) error_per_length: f64,
    opaque_below: f64,
}

impl MarchState {
    pub(super) fn new(quality: VolumeQuality, path: f64) -> Self {
        let levels = match quality {
            VolumeQuality::Tolerance { levels } => f64::from(levels.max(1e-6)),
            VolumeQuality::Step { .. } => 0.1,
        };
        // NaN `levels` became 10⁻⁶ by `max`.
        let budget = 0.5 * levels / 255.0;
        MarchState {
            color: [0.0; 3],
            transmittance: 1.0,
            depth: f64::INFINITY,
            samples: 0,
            quality,
            error_per_length: budget / path.max(f64::MIN_POSITIVE),
            opaque_below: budget,
        }
    }

    #[inline]
    pub(super) fn is_opaque(&self) -> bool {
        self.transmittance < self.opaque_below
    }

    /// Whether the error of the simplified transfer function is small against the tolerance.
    #[inline]
    pub(super) fn allows_simplified(&self) -> bool {
        matches!(self.quality, VolumeQuality::Tolerance { levels } if levels >= SIMPLIFIED_FROM)
    }

    #[inline]
    pub(super) fn add_segment(&mut self, s: &SegmentLight) {
        let before = self.transmittance;
        for (sum, c) in self.color.iter_mut().zip(s.color) {
            *sum += before * c;
        }
        self.transmittance = before * s.attenuation;
        if before > 0.5 && self.transmittance <= 0.5 {
            // Where the segment's own thickness is ln(2T), for extinction linear between its ends.
            let share = ((2.0 * before).ln() / s.tau).min(1.0);
            let [near, far] = s.ends;
            let wanted = share * (near + far);
            let root = (near * near + (far - near) * wanted).max(0.0).sqrt();
            let at = if near + root > 0.0 { wanted / (near + root) } else { share };
            self.depth = s.t[0] + (s.t[1] - s.t[0]) * at.clamp(0.0, 1.0);
        }
    }

    #[inline]
    pub(super) fn add(&mut self, ta: f64, tb: f64, layer: &Layer) {
        if layer.tau <= 0.0 {
            return;
        }
        let [r, g, b, a] = layer.rgba();
        let before = self.transmittance;
        for (sum, c) in self.color.iter_mut().zip([r, g, b]) {
            *sum += before * c;
        }
        self.transmittance = before * (1.0 - a);
        if before > 0.5 && self.transmittance <= 0.5 {
            self.depth = ta + (tb - ta) * ((2.0 * before).ln() / layer.tau).min(1.0);
        }
    }
}

//! Chooses the instances that a query may hit.

/// Which instances rays can hit.
#[derive(Debug, Clone, Copy)]
pub(crate) enum InstanceFilter<'a> {
    /// All instances.
    All,
    /// Marked instances. A missing mark counts as not set.
    #[cfg_attr(not(feature = "render"), allow(dead_code, reason = "only the renderer marks some"))]
    Marked(&'a [bool]),
    /// Unmarked instances.
    #[cfg_attr(not(feature = "render"), allow(dead_code, reason = "only the renderer marks some"))]
    Unmarked(&'a [bool]),
    /// Instances whose mask has a bit of the ray's mask. A missing mask counts as zero.
    Masked { instance_masks: &'a [u32], ray_mask: u32 },
}

impl InstanceFilter<'_> {
    #[inline(always)]
    pub(crate) fn has(self, instance: usize) -> bool {
        match self {
            InstanceFilter::All => true,
            InstanceFilter::Marked(marks) => marks.get(instance).is_some_and(|m| *m),
            InstanceFilter::Masked { instance_masks, ray_mask } => {
                instance_masks.get(instance).is_some_and(|mask| mask & ray_mask != 0)
            }
            InstanceFilter::Unmarked(marks) => !marks.get(instance).is_some_and(|m| *m),
        }
    }
}

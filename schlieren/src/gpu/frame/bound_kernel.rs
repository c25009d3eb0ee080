//! A kernel with what is bound to it.

/// A pipeline, and the two groups of its bindings.
pub(super) type BoundKernel = (wgpu::ComputePipeline, [wgpu::BindGroup; 2]);

/// Records kernels with these numbers of work groups.
pub(super) fn run(
    commands: &mut wgpu::CommandEncoder,
    kernels: &[BoundKernel],
    groups: &[[u32; 2]],
) {
    let mut pass = commands.begin_compute_pass(&Default::default());
    for ((pipeline, bound), [x, y]) in kernels.iter().zip(groups) {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bound[0], &[]);
        pass.set_bind_group(1, &bound[1], &[]);
        pass.dispatch_workgroups(*x, *y, 1);
    }
}

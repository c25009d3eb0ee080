// Marches rays that the host has prepared, one per invocation.

@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<storage, read_write> outputs: array<KernelOutput>;

@compute @workgroup_size(64)
fn march(@builtin(global_invocation_id) id: vec3u) {
    if id.x < params.rays {
        outputs[id.x] = march_ray(rays[id.x]);
    }
}

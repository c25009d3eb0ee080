//! A build from slices copies none of the caller's arrays. In a process of its own, whose memory
//! nothing else changes.
#![forbid(unsafe_code)]

use rt_core::mesh::MeshSlices;
use rt_core::prelude::*;

/// A number of bytes in `/proc/self/status`; `None` where there is no such file.
fn bytes(field: &str) -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with(field))?;
    line.split_whitespace().nth(1)?.parse::<usize>().ok().map(|kib| kib << 10)
}

const MIB: usize = 1 << 20;

#[test]
fn a_build_from_slices_copies_no_array() {
    let Some(_) = bytes("VmHWM:") else {
        eprintln!("skipped: this system does not tell the peak of a process's memory");
        return;
    };
    // 256 MiB of positions that hardly any triangle uses, and 96 MiB of indices of triangles that
    // cannot be built: a builder needs 32 bytes for each, but no tree.
    let (stride, vertices, triangles) = (64, 1 << 20, 8 << 20);
    let positions = vec![0.25f32; stride * vertices];
    let mut indices = vec![u32::MAX; 3 * triangles];
    indices[..3].copy_from_slice(&[0, 1, 2]);
    let mut positions = positions;
    positions[stride] = 0.5;
    positions[2 * stride + 1] = 0.5;
    let mesh = MeshSlices { stride, ..MeshSlices::new(&positions, &indices) };
    let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };

    let before = bytes("VmRSS:").expect("told above");
    let world = World::from_slices(&[mesh], vec![placed], &BuildOptions::default()).unwrap();
    let grown = bytes("VmHWM:").expect("told above").saturating_sub(before);
    assert_eq!(world.report().primitives, 1);
    let needed = 32 * triangles;
    assert!(grown < needed + 48 * MIB, "{} MiB for {} MiB", grown / MIB, needed / MIB);
    // What stays is smaller than either array.
    let stays = bytes("VmRSS:").expect("told above").saturating_sub(before);
    assert!(stays < 64 * MIB, "{} MiB stay", stays / MIB);
}

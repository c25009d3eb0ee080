//! Measures contouring: counting alone, positions and triangles, and additional normals.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use datasets::generate::nested_wavelet::{POINTS, Size};
use datasets::generate::wavelet::Wavelet;
use datasets::isosurface::{Options, count_triangles, extract};
use std::hint::black_box;

fn nested_wavelet(c: &mut Criterion) {
    c.bench_function("wavelet/201", |b| b.iter(|| black_box(Wavelet::with_points(POINTS).grid())));
    let grid = Wavelet::with_points(POINTS).grid().expect("a small grid");
    for size in [Size::M1, Size::M16] {
        let isos = size.isovalues();
        let mut group = c.benchmark_group(format!("isosurface/{}", size.name()));
        group.sample_size(10).throughput(Throughput::Elements(size.triangles() as u64));
        group.bench_function("count", |b| b.iter(|| black_box(count_triangles(&grid, &isos))));
        for (name, normals) in [("triangles", false), ("with normals", true)] {
            let options = Options { normals, ..Default::default() };
            group.bench_function(name, |b| b.iter(|| black_box(extract(&grid, &isos, options))));
        }
        group.finish();
    }
}

criterion_group!(benches, nested_wavelet);
criterion_main!(benches);

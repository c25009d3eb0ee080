//! Watertight ray-triangle test in a sheared space (Woop, Benthin and Wald, "Watertight
//! Ray/Triangle Intersection", JCGT 2013).
//!
//! The triangle is translated to the ray's origin and sheared so that the ray becomes the z axis.
//! Three 2-D edge functions then decide on which side of each edge the origin lies. Two triangles
//! that share an edge evaluate the same products for it with opposite signs. Rounding is monotone,
//! so fl(a·b) − fl(c·d) has the sign of the exact value or is zero. A zero is decided by the exact
//! products in f64. So a ray never passes between the two triangles.
//!
//! The test uses no fused multiply-add, so every instruction set gives the same bits, in packets
//! and for single rays, and the products above are equal on both sides of an edge.

use crate::bvh::query::TriangleTest;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};

/// Axis order and shear that map a ray's direction to +z.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shear {
    pub(crate) kx: usize,
    pub(crate) ky: usize,
    pub(crate) kz: usize,
    pub(crate) sx: f32,
    pub(crate) sy: f32,
    pub(crate) sz: f32,
}

/// The axis with the largest component; ties go to the lower axis.
#[inline(always)]
pub(crate) fn dominant_axis(d: [f32; 3]) -> usize {
    let a = d.map(f32::abs);
    let xy = if a[0] >= a[1] { 0 } else { 1 };
    if a[xy] >= a[2] { xy } else { 2 }
}

impl Shear {
    #[inline(always)]
    pub(crate) fn new(d: [f32; 3]) -> Self {
        let kz = dominant_axis(d);
        // The paper swaps kx and ky for negative d[kz] to keep the winding. Here both windings are
        // hits, so nothing depends on it.
        let (kx, ky) = ([1, 2, 0][kz], [2, 0, 1][kz]);
        let sz = 1.0 / d[kz];
        Shear { kx, ky, kz, sx: d[kx] * sz, sy: d[ky] * sz, sz }
    }
}

/// Lanes that may be hits: the ray passes inside the edges at a finite `t`.
pub(crate) struct Candidate<V, M> {
    pub(crate) inside: M,
    /// Ray parameter.
    pub(crate) t: V,
    /// Barycentric weight of the second vertex.
    pub(crate) u: V,
    /// Barycentric weight of the third vertex.
    pub(crate) v: V,
}

/// Tests lanes of (triangle, ray) pairs. `a`, `b`, `c` are the vertices minus the ray's origin, in
/// the axis order kx, ky, kz. Returns `None` when no lane passes the edge tests.
#[inline(always)]
pub(crate) fn test<S, V, T>(
    simd: S,
    a: [V; 3],
    b: [V; 3],
    c: [V; 3],
    sx: V,
    sy: V,
    sz: V,
) -> Option<Candidate<V, V::Mask>>
where
    S: Simd,
    V: SimdFloat<S, Element = f32> + Lanes<S>,
    V::Mask: Select<V>,
    T: TriangleTest,
{
    let zero = V::splat(simd, 0.0);
    let (ax, ay) = (a[0] - sx * a[2], a[1] - sy * a[2]);
    let (bx, by) = (b[0] - sx * b[2], b[1] - sy * b[2]);
    let (cx, cy) = (c[0] - sx * c[2], c[1] - sy * c[2]);
    let mut u = cx * by - cy * bx;
    let mut v = ax * cy - ay * cx;
    let mut w = bx * ay - by * ax;
    // All signs equal, zeros allowed.
    let mut inside = one_sign(simd, u, v, w);
    if !inside.any_true() {
        return None;
    }
    if T::WATERTIGHT {
        // A zero matters only where the other two values agree in sign. There it is the smallest or
        // the largest of the three.
        let undecided = inside & (u.min(v).min(w).simd_eq(zero) | u.max(v).max(w).simd_eq(zero));
        if undecided.any_true() {
            // Only the undecided lanes change. The bits of the others must not depend on their
            // neighbours.
            u = undecided.select(exact(simd, cx, by, cy, bx), u);
            v = undecided.select(exact(simd, ax, cy, ay, cx), v);
            w = undecided.select(exact(simd, bx, ay, by, ax), w);
            inside &= one_sign(simd, u, v, w);
        }
    }
    let det = u + v + w;
    let inside = inside & det.simd_ne(zero);
    // The weights are computed first: products of tiny edge functions and distances would
    // underflow, and so would t.
    let scale = V::splat(simd, 1.0) / det;
    let (u, v, w) = (u * scale, v * scale, w * scale);
    let t = (u * a[2] + v * b[2] + w * c[2]) * sz;
    Some(Candidate { inside, t, u: v, v: w })
}

/// Lanes in which no two of the three have opposite signs.
#[inline(always)]
fn one_sign<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, u: V, v: V, w: V) -> V::Mask {
    let zero = V::splat(simd, 0.0);
    u.min(v).min(w).simd_ge(zero) | u.max(v).max(w).simd_le(zero)
}

/// p·q − r·s from exact f64 products, rounded to f32. The result is zero only when the difference
/// is. Not inlined, and scalar code, because it runs for one ray in thousands.
#[inline(never)]
fn exact<S: Simd, V: SimdFloat<S, Element = f32> + Lanes<S>>(simd: S, p: V, q: V, r: V, s: V) -> V {
    let (p, q, r, s) = (p.lanes(), q.lanes(), r.lanes(), s.lanes());
    V::from_fn(simd, |i| {
        let d = p.as_ref()[i] as f64 * q.as_ref()[i] as f64
            - r.as_ref()[i] as f64 * s.as_ref()[i] as f64;
        let f = d as f32;
        // The cast may flush a tiny difference to zero, which would report a tie where there is
        // none.
        if f == 0.0 && d != 0.0 { f32::MIN_POSITIVE.copysign(d as f32) } else { f }
    })
}

/// Conversion of a vector to an array of its lanes.
pub(crate) trait Lanes<S> {
    type Array: AsRef<[f32]>;
    fn lanes(self) -> Self::Array;
}

macro_rules! lanes {
    ($($v:ident $n:literal),*) => {$(
        impl<S: Simd> Lanes<S> for fearless_simd::$v<S> {
            type Array = [f32; $n];
            #[inline(always)]
            fn lanes(self) -> [f32; $n] {
                self.to_array()
            }
        }
    )*};
}
lanes!(f32x4 4, f32x8 8, f32x16 16);

//! One attribute of the vertices of a batch.

use crate::capture::draw::Values;

/// The values of one attribute. They cost nothing while they do not change.
pub(super) struct AttributeStream<const N: usize> {
    pub(super) varying: bool,
    pub(super) constant: [f32; N],
    pub(super) values: Vec<[f32; N]>,
    /// Memory of earlier frames. New pages would cost as much as filling them.
    spares: Vec<Vec<[f32; N]>>,
}

impl<const N: usize> Default for AttributeStream<N> {
    fn default() -> Self {
        AttributeStream {
            varying: false,
            constant: [0.0; N],
            values: Vec::new(),
            spares: Vec::new(),
        }
    }
}

impl<const N: usize> AttributeStream<N> {
    #[inline(always)]
    pub(super) fn set(&mut self, v: [f32; N], vertices: usize) {
        if self.varying {
            return;
        }
        if vertices == 0 {
            self.constant = v;
        } else if !same_bits(&[v], &[self.constant]) {
            self.vary(vertices);
        }
    }

    #[cold]
    #[inline(never)]
    pub(super) fn vary(&mut self, vertices: usize) {
        self.values = self.spares.pop().unwrap_or_default();
        self.values.clear();
        self.values.resize(vertices, self.constant);
        self.varying = true;
    }

    pub(super) fn take(&mut self) -> Values<N> {
        let varying = std::mem::take(&mut self.varying);
        match varying {
            true => Values::PerVertex(std::mem::take(&mut self.values)),
            false => Values::Constant(self.constant),
        }
    }

    /// Takes back the memory of values from [`AttributeStream::take`].
    pub(super) fn recycle(&mut self, values: Values<N>) {
        if let Values::PerVertex(v) = values {
            self.spare(v);
        }
    }

    pub(super) fn spare(&mut self, v: Vec<[f32; N]>) {
        const MOST: usize = 16;
        if v.capacity() > 0 && self.spares.len() < MOST {
            self.spares.push(v);
        }
    }
}

/// Compares bit by bit: NaN equals itself.
#[inline(always)]
pub(crate) fn same_bits<const N: usize>(a: &[[f32; N]], b: &[[f32; N]]) -> bool {
    bytemuck::cast_slice::<_, u8>(a) == bytemuck::cast_slice::<_, u8>(b)
}

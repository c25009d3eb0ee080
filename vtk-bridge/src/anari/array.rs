//! Arrays: who owns their memory, and access to their elements as values.
//!
//! ANARI 1.0, section "Array objects", has three kinds of ownership. Shared memory belongs to the
//! program until it releases the array; the device then copies it, because the program may free it.
//! Captured memory comes with a deleter. Managed memory belongs to the device, and the program
//! fills it by mapping it.

use super::data_type::DataType;
use super::memory::{AppMemory, OwnMemory};
use super::object::Object;
use std::sync::Arc;

/// Owner of an array's memory.
pub(crate) enum Storage {
    /// The program's memory: shared, or captured if it has a deleter.
    App(AppMemory),
    /// The device's memory.
    Own(OwnMemory),
}

/// The data of an array object.
pub struct Array {
    storage: Storage,
    /// Type of an element.
    pub element: DataType,
    /// Number of elements per dimension; 1 where the array has fewer dimensions.
    pub dims: [usize; 3],
    /// Strong references to objects named in the data.
    objects: Vec<Option<Arc<Object>>>,
    /// Whether the program may be writing to the memory now.
    pub(crate) mapped: bool,
    /// For one-dimensional arrays, the first element in use and one past the last.
    pub(crate) region: Option<[usize; 2]>,
}

/// More bytes than any array can have.
const MOST_BYTES: usize = isize::MAX as usize / 2;

/// Bytes of `dims` elements; `None` if the size does not fit into an address.
pub(crate) fn byte_size(element: DataType, dims: [u64; 3]) -> Option<usize> {
    let mut bytes = element.size()?;
    for d in dims {
        bytes = bytes.checked_mul(usize::try_from(d).ok()?)?;
    }
    (bytes <= MOST_BYTES).then_some(bytes)
}

impl Array {
    pub(crate) fn new(storage: Storage, element: DataType, dims: [u64; 3]) -> Array {
        let dims = dims.map(|d| d as usize);
        Array { storage, element, dims, objects: Vec::new(), mapped: false, region: None }
    }

    /// The number of elements in use.
    pub fn len(&self) -> usize {
        let all = self.dims.iter().product();
        self.region.map_or(all, |[a, b]| b.min(all).saturating_sub(a))
    }

    /// True if there are no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies the elements' bytes, because the program may change its memory at any time
    /// afterwards.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let all = match &self.storage {
            Storage::App(m) => m.copy(),
            Storage::Own(m) => m.copy(),
        };
        match (self.region, self.element.size()) {
            (Some([a, _]), Some(size)) => all[a * size..(a + self.len()) * size].to_vec(),
            _ => all,
        }
    }

    /// The address that the program writes to.
    pub(crate) fn address(&self) -> *mut std::ffi::c_void {
        match &self.storage {
            Storage::App(m) => m.address(),
            Storage::Own(m) => m.address(),
        }
    }

    /// Copies shared memory that the program may free from now on. Returns true if it made a copy.
    pub(crate) fn privatize(&mut self) -> bool {
        let Storage::App(shared) = &self.storage else { return false };
        if shared.is_captured() {
            return false;
        }
        self.storage = Storage::Own(OwnMemory::from_bytes(&shared.copy()));
        true
    }

    /// The existing objects that the elements name.
    pub fn objects(&self) -> &[Option<Arc<Object>>] {
        match self.region {
            Some([a, _]) => {
                &self.objects[a.min(self.objects.len())..(a + self.len()).min(self.objects.len())]
            }
            None => &self.objects,
        }
    }

    pub(crate) fn set_objects(
        &mut self,
        objects: Vec<Option<Arc<Object>>>,
    ) -> Vec<Option<Arc<Object>>> {
        std::mem::replace(&mut self.objects, objects)
    }

    /// All handles in the memory, whether or not they are in the region in use.
    pub(crate) fn handles(&self) -> Vec<u64> {
        let all = match &self.storage {
            Storage::App(m) => m.copy(),
            Storage::Own(m) => m.copy(),
        };
        all.chunks_exact(8)
            .map(|c| u64::from_ne_bytes([c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]]))
            .collect()
    }

    // ---- Elements as values ---------------------------------------------------------------------
    /// Attribute values: see [`DataType::attribute`].
    pub(crate) fn attributes(&self) -> Vec<[f32; 4]> {
        let Some(size) = self.element.size() else { return Vec::new() };
        self.bytes().chunks_exact(size).map(|b| self.element.attribute(b)).collect()
    }

    /// The first component of each element.
    pub(crate) fn scalars(&self) -> Vec<f32> {
        if self.element == DataType::FLOAT32 {
            return self
                .bytes()
                .chunks_exact(4)
                .map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
        }
        self.attributes().into_iter().map(|a| a[0]).collect()
    }

    /// Three-component vectors.
    pub(crate) fn vectors(&self) -> Vec<[f32; 3]> {
        if self.element == DataType::FLOAT32_VEC3 {
            let f = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
            return self
                .bytes()
                .chunks_exact(12)
                .map(|b| [f(&b[..4]), f(&b[4..8]), f(&b[8..])])
                .collect();
        }
        self.attributes().into_iter().map(|a| [a[0], a[1], a[2]]).collect()
    }

    /// Indices, `N` per element. An index that does not fit into 32 bits becomes `u32::MAX`, which
    /// is always out of range.
    pub(crate) fn indices<const N: usize>(&self) -> Vec<[u32; N]> {
        let Some(size) = self.element.size() else { return Vec::new() };
        let wide = size / N == 8;
        let one = |b: &[u8]| {
            if wide {
                let v = u64::from_ne_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]);
                u32::try_from(v).unwrap_or(u32::MAX)
            } else {
                u32::from_ne_bytes([b[0], b[1], b[2], b[3]])
            }
        };
        let step = size / N;
        self.bytes()
            .chunks_exact(size)
            .map(|b| std::array::from_fn(|i| one(&b[i * step..(i + 1) * step])))
            .collect()
    }

    /// 4 x 4 matrices in column-major order.
    pub(crate) fn matrices(&self) -> Vec<[f64; 16]> {
        self.bytes()
            .chunks_exact(64)
            .map(|m| {
                let f = |i: usize| {
                    f32::from_ne_bytes([m[4 * i], m[4 * i + 1], m[4 * i + 2], m[4 * i + 3]])
                };
                std::array::from_fn(|i| f64::from(f(i)))
            })
            .collect()
    }
}

impl Object {
    /// Reads the data of an array; `None` for other objects.
    pub(crate) fn with_array<T>(&self, f: impl FnOnce(&mut Array) -> T) -> Option<T> {
        self.with_state(f)
    }

    /// The objects in an array parameter, in order and without nulls.
    pub(crate) fn objects(&self, name: &str) -> Vec<Arc<Object>> {
        let listed = |a: &mut Array| a.objects().iter().flatten().cloned().collect();
        self.object(name).and_then(|a| a.with_array(listed)).unwrap_or_default()
    }
}

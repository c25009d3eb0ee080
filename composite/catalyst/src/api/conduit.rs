//! Conduit's C interface, as `libcatalyst` has it in itself or is linked with it.

use crate::node::{Node, Numbers};
use datasets::model::ScalarType;
use libloading::os::unix::{Library, RTLD_NOW};
use std::ffi::{CStr, CString, c_char, c_void};

/// Trees are not deeper than this; a channel's deepest node is at 8 or so.
const DEEPEST: usize = 64;
/// `RTLD_NOLOAD` of Linux: finds what is loaded already.
const RTLD_NOLOAD: i32 = 4;
/// What Conduit calls `libcatalyst`, and a Conduit beside it, among the files in memory.
const LIBRARIES: [&str; 2] = ["libcatalyst.so", "libconduit.so"];
/// Before the names of Conduit's functions in `libcatalyst`; nothing in a Conduit of its own.
const PREFIXES: [&str; 2] = ["catalyst_", ""];

// Numbers of types (conduit_bitwidth_style_types.h).
const OBJECT: i64 = 1;
const LIST: i64 = 2;
const TEXT: i64 = 13;
/// Types 3 to 12.
const NUMBERS: [ScalarType; 10] = [
    ScalarType::I8,
    ScalarType::I16,
    ScalarType::I32,
    ScalarType::I64,
    ScalarType::U8,
    ScalarType::U16,
    ScalarType::U32,
    ScalarType::U64,
    ScalarType::F32,
    ScalarType::F64,
];
/// Most significant byte first (conduit_endianness_types.h).
const BIG_ENDIAN: i64 = 1;

type OfNode<R> = unsafe extern "C" fn(*mut c_void) -> R;
type OfType = unsafe extern "C" fn(*const c_void) -> i64;

unsafe extern "C" {
    /// Conduit copies names with `malloc`.
    fn free(memory: *mut c_void);
}

/// The functions that are called here. `conduit_index_t` has 64 bits, as `libcatalyst` is built.
pub(super) struct Conduit {
    dtype: OfNode<*const c_void>,
    number_of_children: OfNode<i64>,
    child: unsafe extern "C" fn(*mut c_void, i64) -> *mut c_void,
    name: OfNode<*mut c_char>,
    data: OfNode<*mut c_void>,
    element: unsafe extern "C" fn(*mut c_void, i64) -> *mut c_void,
    id: OfType,
    number_of_elements: OfType,
    stride: OfType,
    endianness: OfType,
    set_text: unsafe extern "C" fn(*mut c_void, *const c_char, *const c_char),
    set_integer: unsafe extern "C" fn(*mut c_void, *const c_char, i64),
}

impl Conduit {
    /// The functions in this process.
    ///
    /// # Errors
    /// In words, what is missing.
    pub(super) fn of_process() -> Result<Conduit, String> {
        let mut libraries = vec![Library::this()];
        // A simulation in Python, or one that loads its adaptor, has libcatalyst where the names
        // of the process do not reach it.
        for file in loaded_files() {
            // SAFETY: the library is there already, or nothing is loaded.
            libraries.extend(unsafe { Library::open(Some(&file), RTLD_NOW | RTLD_NOLOAD) });
        }
        for library in &libraries {
            for prefix in PREFIXES {
                if let Some(found) = Conduit::of(library, prefix) {
                    return Ok(found);
                }
            }
        }
        Err("no libcatalyst with Conduit's functions is in this process: this library is loaded \
             by Catalyst 2, with CATALYST_IMPLEMENTATION_NAME=rtsv"
            .into())
    }

    fn of(library: &Library, prefix: &str) -> Option<Conduit> {
        macro_rules! function {
            ($name:literal) => {{
                let name = format!("{prefix}conduit_{}", $name);
                // SAFETY: the types are those of conduit_node.h and conduit_datatype.h. The
                // library stays: it is in use by who calls this one.
                *unsafe { library.get(name.as_bytes()) }.ok()?
            }};
        }
        Some(Conduit {
            dtype: function!("node_dtype"),
            number_of_children: function!("node_number_of_children"),
            child: function!("node_child"),
            name: function!("node_name"),
            data: function!("node_data_ptr"),
            element: function!("node_element_ptr"),
            id: function!("datatype_id"),
            number_of_elements: function!("datatype_number_of_elements"),
            stride: function!("datatype_stride"),
            endianness: function!("datatype_endianness"),
            set_text: function!("node_set_path_char8_str"),
            set_integer: function!("node_set_path_int64"),
        })
    }

    /// The tree of a node. Arrays are borrowed.
    ///
    /// # Safety
    /// `node` is a node of this Conduit; its arrays have the lengths that it says, and neither it
    /// nor they change while the tree is used.
    ///
    /// # Errors
    /// In words, what cannot be read, by its path.
    pub(super) unsafe fn tree<'a>(&self, node: *const c_void) -> Result<Node<'a>, String> {
        // SAFETY: the caller's promise. The functions take a mutable node, which they do not
        // change.
        unsafe { self.node(node.cast_mut(), 0) }.map_err(|(path, reason)| {
            let names: Vec<&str> = path.iter().rev().map(String::as_str).collect();
            format!("{}: {reason}", names.join("/"))
        })
    }

    /// # Safety
    /// As [`tree`](Self::tree).
    ///
    /// # Errors
    /// The names of the path, the last one first, and what cannot be read there.
    unsafe fn node<'a>(
        &self,
        node: *mut c_void,
        depth: usize,
    ) -> Result<Node<'a>, (Vec<String>, String)> {
        let here = |reason: String| (Vec::new(), reason);
        if node.is_null() || depth > DEEPEST {
            return Err(here("there is no node, or the tree is too deep".into()));
        }
        // SAFETY: a node of this Conduit, and its type, here and below.
        let dtype = unsafe { (self.dtype)(node) };
        // SAFETY: as above.
        let id = unsafe { (self.id)(dtype) };
        if id == OBJECT || id == LIST {
            // SAFETY: as above.
            let count = unsafe { (self.number_of_children)(node) };
            let mut children = Vec::new();
            for k in 0..count {
                // SAFETY: as above; there are so many children.
                let child = unsafe { (self.child)(node, k) };
                let name = match id {
                    // SAFETY: as above.
                    OBJECT => unsafe { self.name_of(child) },
                    _ => k.to_string(),
                };
                // SAFETY: as above.
                match unsafe { self.node(child, depth + 1) } {
                    Ok(node) => children.push((name, node)),
                    Err((mut path, reason)) => {
                        path.push(name);
                        return Err((path, reason));
                    }
                }
            }
            return Ok(Node::Children(children));
        }
        if id != TEXT && !(3..TEXT).contains(&id) {
            return Ok(Node::Empty);
        }
        // SAFETY: as above.
        let count = unsafe { (self.number_of_elements)(dtype) };
        let count = usize::try_from(count).map_err(|_| here(format!("{count} elements")))?;
        // SAFETY: as above.
        if count == 0 || unsafe { (self.data)(node) }.is_null() {
            return Ok(match id {
                TEXT => Node::Text(String::new()),
                _ if count == 0 => Node::Numbers(Numbers::of::<f64>(&[])),
                _ => return Err(here(format!("{count} numbers at a null pointer"))),
            });
        }
        // SAFETY: as above; there is an element 0.
        let first = unsafe { (self.element)(node, 0) }.cast::<u8>();
        let kind = if id == TEXT { ScalarType::U8 } else { NUMBERS[(id - 3) as usize] };
        // SAFETY: as above.
        let (stride, order) = unsafe { ((self.stride)(dtype), (self.endianness)(dtype)) };
        if order == BIG_ENDIAN && kind.size() > 1 {
            return Err(here("numbers with the most significant byte first".into()));
        }
        let size = usize::try_from(stride)
            .ok()
            .and_then(|stride| (count - 1).checked_mul(stride)?.checked_add(kind.size()));
        let size = size.filter(|s| *s <= isize::MAX as usize);
        let size = size.ok_or_else(|| here(format!("{count} numbers {stride} bytes apart")))?;
        // SAFETY: the memory of so many elements, as the caller promises; what lies between them
        // is in the same array.
        let bytes: &'a [u8] = unsafe { std::slice::from_raw_parts(first, size) };
        if id == TEXT {
            let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
            return Ok(Node::Text(String::from_utf8_lossy(&bytes[..end]).into_owned()));
        }
        let numbers = Numbers::strided(bytes, kind, count, stride as usize);
        Ok(numbers.map_or(Node::Empty, Node::Numbers))
    }

    /// # Safety
    /// `node` is a node of this Conduit.
    unsafe fn name_of(&self, node: *mut c_void) -> String {
        // SAFETY: the caller's promise.
        let name = unsafe { (self.name)(node) };
        if name.is_null() {
            return String::new();
        }
        // SAFETY: Conduit returns a copy that ends with a zero byte.
        let text = unsafe { CStr::from_ptr(name) }.to_string_lossy().into_owned();
        // SAFETY: the copy is the caller's.
        unsafe { free(name.cast()) };
        text
    }

    /// Sets a text at a path; does nothing for a null pointer.
    ///
    /// # Safety
    /// `node` is null or a node of this Conduit that may be changed.
    pub(super) unsafe fn set_text(&self, node: *mut c_void, path: &str, text: &str) {
        let [path, text] = [path, text].map(|s| CString::new(s.replace('\0', " ")));
        if let (false, Ok(path), Ok(text)) = (node.is_null(), path, text) {
            // SAFETY: the caller's promise; both texts end with a zero byte.
            unsafe { (self.set_text)(node, path.as_ptr(), text.as_ptr()) };
        }
    }

    /// Sets an integer at a path; does nothing for a null pointer.
    ///
    /// # Safety
    /// As [`set_text`](Self::set_text).
    pub(super) unsafe fn set_integer(&self, node: *mut c_void, path: &str, value: i64) {
        if let (false, Ok(path)) = (node.is_null(), CString::new(path)) {
            // SAFETY: the caller's promise.
            unsafe { (self.set_integer)(node, path.as_ptr(), value) };
        }
    }
}

/// The files of `libcatalyst` and Conduit that this process has in its memory.
fn loaded_files() -> Vec<String> {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    let mut files: Vec<String> = Vec::new();
    for line in maps.lines() {
        let Some(at) = line.find('/') else { continue };
        let file = &line[at..];
        let name = file.rsplit('/').next().unwrap_or_default();
        if LIBRARIES.iter().any(|l| name.starts_with(l)) && files.iter().all(|f| f != file) {
            files.push(file.to_owned());
        }
    }
    files
}

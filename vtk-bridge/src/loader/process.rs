//! Lists the shared libraries in the process and opens another one.

use super::Shim;
use crate::capi::{RTV_ABI, RtvApi, rtv_api};
use std::ffi::{CStr, CString, c_void};
use std::os::raw::{c_char, c_int};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// Paths of all shared libraries in the process.
pub(super) fn loaded_files() -> Vec<String> {
    unsafe extern "C" fn collect(
        info: *mut libc::dl_phdr_info,
        _: usize,
        list: *mut c_void,
    ) -> c_int {
        // SAFETY: dl_iterate_phdr passes a valid entry, and back the pointer it was given below.
        let (info, list) = unsafe { (&*info, &mut *list.cast::<Vec<String>>()) };
        if !info.dlpi_name.is_null() {
            // SAFETY: the name is a C string that lives as long as the library is loaded.
            list.push(unsafe { CStr::from_ptr(info.dlpi_name) }.to_string_lossy().into_owned());
        }
        0
    }
    let mut list: Vec<String> = Vec::new();
    // SAFETY: the callback has the right type and uses the list only during the call.
    unsafe { libc::dl_iterate_phdr(Some(collect), (&raw mut list).cast()) };
    list
}

/// The file that contains this code.
pub(super) fn own_file() -> Option<PathBuf> {
    // SAFETY: a plain structure of pointers, for which zero is valid.
    let mut info: libc::Dl_info = unsafe { std::mem::zeroed() };
    // SAFETY: dladdr reads an address and fills in the structure.
    let found = unsafe { libc::dladdr(own_file as *const c_void, &mut info) };
    if found == 0 || info.dli_fname.is_null() {
        return None;
    }
    // SAFETY: a C string that lives as long as this library is loaded.
    let name = unsafe { CStr::from_ptr(info.dli_fname) };
    let path = Path::new(std::ffi::OsStr::from_bytes(name.to_bytes()));
    path.canonicalize().ok()
}

/// Opens the shim and passes it our function table.
pub(super) fn open_shim(path: &Path) -> Result<Shim, String> {
    let file = CString::new(path.as_os_str().as_bytes()).map_err(|e| e.to_string())?;
    // SAFETY: a C string; what runs on loading is what `vtk-bridge install` compiled.
    let handle = unsafe { libc::dlopen(file.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
    if handle.is_null() {
        // SAFETY: after a failure dlerror returns a C string, or null.
        let error = unsafe { libc::dlerror() };
        // SAFETY: checked for null.
        let text = (!error.is_null())
            .then(|| unsafe { CStr::from_ptr(error) }.to_string_lossy().into_owned());
        return Err(text.unwrap_or_else(|| "dlopen failed without a reason".to_owned()));
    }
    let symbol = |name: &CStr| {
        // SAFETY: an open library and a C string.
        let address = unsafe { libc::dlsym(handle, name.as_ptr()) };
        if address.is_null() {
            Err(format!("it has no {}", name.to_string_lossy()))
        } else {
            Ok(address)
        }
    };
    let (init, version, load) =
        (symbol(c"rtv_shim_init")?, symbol(c"vtkGetFactoryVersion")?, symbol(c"vtkLoad")?);
    // SAFETY: the shim declares these functions with these signatures (cpp/rtv_factory.cxx).
    let (init, version, load) = unsafe {
        (
            std::mem::transmute::<*mut c_void, unsafe extern "C" fn(*const RtvApi) -> u32>(init),
            std::mem::transmute::<*mut c_void, unsafe extern "C" fn() -> *const c_char>(version),
            std::mem::transmute::<*mut c_void, unsafe extern "C" fn() -> *mut c_void>(load),
        )
    };
    // SAFETY: the table lives as long as this library, which is never unloaded.
    let abi = unsafe { init(rtv_api()) };
    if abi != RTV_ABI {
        return Err(format!("it was built for interface {abi}, this library has {RTV_ABI}"));
    }
    Ok(Shim { version, load })
}

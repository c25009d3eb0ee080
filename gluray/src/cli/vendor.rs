//! The folder in which GLVND finds this library: links with the names of vendor libraries that
//! point to it, and its JSON description for EGL.
//!
//! The folder is the same for all runs with the same library and is never removed. A child of the
//! program may outlive `gluray run` with variables that name the folder, and must find a vendor
//! there when it first uses OpenGL. The folder therefore lies with the user's runtime files. Only
//! the user may write to it and to its parents, because programs load code from there.

use crate::host::folders;
use anyhow::{Context as _, bail};
use datasets::cli::CureExt as _;
use std::fs;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

/// The folder with its files, and the description for EGL in it.
pub(super) struct VendorFolder {
    pub(super) folder: PathBuf,
    pub(super) egl: PathBuf,
}

impl VendorFolder {
    /// The folder for `library`, an absolute path: with the files of running programs, or in the
    /// cache where that cannot be.
    pub(super) fn of(library: &Path) -> anyhow::Result<VendorFolder> {
        let places = [folders::runtime(folders::variable), folders::cache(folders::variable)];
        let mut made = Err(anyhow::anyhow!("there is no folder for running programs"));
        for place in places.into_iter().flatten() {
            made = VendorFolder::within(&place, library);
            if made.is_ok() {
                break;
            }
        }
        made.context("cannot make the folder in which OpenGL finds gluray").cure(
            "set XDG_RUNTIME_DIR to a folder of your own that others may not write to, or \
                   run with `--via preload`",
        )
    }

    fn within(place: &Path, library: &Path) -> anyhow::Result<VendorFolder> {
        let folder = place.join(format!("vendor-{:016x}", name_of(library)));
        for made in [place, &folder] {
            private(made)?;
        }
        for name in ["libGLX_gluray.so.0", "libEGL_gluray.so.0"] {
            let file = folder.join(name);
            if fs::read_link(&file).ok().as_deref() != Some(library) {
                put(&file, |new| std::os::unix::fs::symlink(library, new))?;
            }
        }
        let egl = folder.join("egl.json");
        let icd = folder.join("libEGL_gluray.so.0");
        let text =
            serde_json::json!({ "file_format_version": "1.0.0", "ICD": { "library_path": icd } });
        let text = text.to_string();
        let there =
            folders::open_own(&egl).and_then(|(file, _)| std::io::read_to_string(file).ok());
        if there.as_ref() != Some(&text) {
            put(&egl, |new| fs::write(new, &text))?;
        }
        Ok(VendorFolder { folder, egl })
    }
}

/// FNV-1a of the path: another library has another folder.
fn name_of(library: &Path) -> u64 {
    let step = |h: u64, b: &u8| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3);
    library.as_os_str().as_bytes().iter().fold(0xcbf2_9ce4_8422_2325, step)
}

/// Makes a folder that only its user may write to, or finds it so.
fn private(folder: &Path) -> anyhow::Result<()> {
    let shown = folder.display();
    fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(folder)
        .with_context(|| format!("{shown}: cannot be made"))?;
    let about =
        fs::symlink_metadata(folder).with_context(|| format!("{shown}: cannot be looked at"))?;
    if !about.is_dir() || Some(about.uid()) != folders::user_id() || about.mode() & 0o022 != 0 {
        bail!("{shown}: is no folder of yours, or others may write to it");
    }
    Ok(())
}

/// Makes a file under another name and gives it its own when it is whole: other runs, and programs,
/// may be looking.
fn put(file: &Path, make: impl FnOnce(&Path) -> std::io::Result<()>) -> anyhow::Result<()> {
    let mut new = file.as_os_str().to_owned();
    new.push(format!(".{}", std::process::id()));
    let new = PathBuf::from(new);
    // What an earlier process of this number left.
    fs::remove_file(&new).ok();
    make(&new)
        .and_then(|()| fs::rename(&new, file))
        .with_context(|| format!("{}: cannot be made", file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn runs_with_the_same_library_share_a_folder_that_nobody_else_may_write_to() {
        let place = tempfile::tempdir().expect("a folder");
        let library = Path::new("/somewhere/libgluray.so");
        let inside = place.path().join("gluray");
        let of = |library| VendorFolder::within(&inside, library);
        let (one, again) = (of(library).expect("a folder"), of(library).expect("a folder"));
        assert_eq!((&one.folder, &one.egl), (&again.folder, &again.egl));
        for folder in [&inside, &one.folder] {
            assert_eq!(fs::metadata(folder).expect("there").mode() & 0o777, 0o700);
        }
        assert_eq!(fs::read_link(one.folder.join("libGLX_gluray.so.0")).expect("a link"), library);
        assert!(fs::read_to_string(&one.egl).expect("a file").contains("libEGL_gluray.so.0"));
        let other = of(Path::new("/elsewhere/libgluray.so")).expect("a folder");
        assert_ne!(other.folder, one.folder);

        // What is there and wrong is put right.
        fs::remove_file(one.folder.join("libEGL_gluray.so.0")).expect("it was there");
        std::os::unix::fs::symlink("/nowhere", one.folder.join("libEGL_gluray.so.0"))
            .expect("a link");
        fs::write(&one.egl, "{}").expect("written");
        of(library).expect("a folder");
        assert_eq!(fs::read_link(one.folder.join("libEGL_gluray.so.0")).expect("a link"), library);
        assert!(fs::read_to_string(&one.egl).expect("a file").contains("library_path"));
        assert_eq!(fs::read_dir(&one.folder).expect("a folder").count(), 3, "nothing else is left");

        for open in [&one.folder, &inside] {
            fs::set_permissions(open, fs::Permissions::from_mode(0o777)).expect("its own folder");
            let refused = of(library).err().expect("others may write to it").to_string();
            assert!(refused.contains(open.to_str().expect("UTF-8")), "{refused}");
            fs::set_permissions(open, fs::Permissions::from_mode(0o700)).expect("its own folder");
        }
        let link = place.path().join("link");
        std::os::unix::fs::symlink(&inside, &link).expect("a link");
        assert!(
            VendorFolder::within(&link, library).is_err(),
            "a link may lead to another place later"
        );
    }
}

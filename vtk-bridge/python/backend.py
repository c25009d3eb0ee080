"""Builds the wheel and the source archive (PEP 517) with Python's standard library and cargo.

The wheel has the package and the shared library of vtk-bridge: $RTVTK_LIBRARY, or what `cargo build
--release -p vtk-bridge --lib` makes in the workspace of this folder. The source archive has the
workspace's members that the library is made of, so that cargo alone builds it.
"""
import base64
import hashlib
import io
import json
import os
import pathlib
import re
import subprocess
import sysconfig
import tarfile
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
NAME, VERSION = "rtvtk", "0.1.0"
MEMBER = "vtk-bridge"
LICENSES = ("LICENSE-APACHE", "LICENSE-MIT")
METADATA = f"""Metadata-Version: 2.4
Name: {NAME}
Version: {VERSION}
Summary: Ray tracing inside unmodified VTK scripts, for the stock vtk wheel
Requires-Python: >=3.9
Requires-Dist: vtk>=9.4
Requires-Dist: numpy
License-Expression: MIT OR Apache-2.0
{"".join(f"License-File: {name}{chr(10)}" for name in LICENSES)}"""


def cargo(*arguments, **options):
    """Runs cargo in the workspace of this folder and returns what it prints."""
    program = [os.environ.get("CARGO", "cargo"), *arguments]
    return subprocess.run(program, cwd=HERE, check=True, stdout=subprocess.PIPE, **options).stdout


def workspace():
    """What cargo knows of the workspace, which is this folder in a source archive."""
    return json.loads(cargo("metadata", "--no-deps", "--format-version", "1"))


def library():
    """The shared library to ship."""
    given = os.environ.get("RTVTK_LIBRARY")
    if given:
        path = pathlib.Path(given)
        if not path.is_file():
            raise SystemExit(
                f"RTVTK_LIBRARY is {given}, which is no file; leave it out to build the library "
                "with cargo"
            )
        return path
    # Without the names and lines that only a debugger reads: they are most of the file.
    plain = {"CARGO_PROFILE_RELEASE_DEBUG": "none", "CARGO_PROFILE_RELEASE_STRIP": "symbols"}
    build = ("build", "--release", "-p", MEMBER, "--lib", "--no-default-features")
    cargo(*build, env=plain | dict(os.environ))
    return pathlib.Path(workspace()["target_directory"]) / "release" / "libvtk_bridge.so"


def platform_of(data):
    """The wheel's platform: the oldest glibc that has all that the library asks it for."""
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    versions = [int(v) for v in re.findall(rb"\0GLIBC_2\.(\d+)(?:\.\d+)?(?=\0)", data)]
    if not platform.startswith("linux_") or not versions:
        return platform
    # There is no policy before 2.5.
    return f"manylinux_2_{max(*versions, 5)}_{platform[len('linux_'):]}"


def license_files():
    """Names and texts of the licences, which lie beside the member or in this folder."""
    found = ((name, folder / name) for name in LICENSES for folder in (HERE.parent, HERE))
    return {name: path.read_bytes() for name, path in found if path.is_file()}


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    info = f"{NAME}-{VERSION}.dist-info"
    files = {f"{NAME}/{p.name}": p.read_bytes() for p in sorted((HERE / NAME).glob("*.py"))}
    files[f"{NAME}/libvtk_bridge.so"] = shared = library().read_bytes()
    tag = f"py3-none-{platform_of(shared)}"
    files[f"{info}/METADATA"] = METADATA.encode()
    wheel = f"Wheel-Version: 1.0\nGenerator: rtvtk\nRoot-Is-Purelib: false\nTag: {tag}\n"
    files[f"{info}/WHEEL"] = wheel.encode()
    files[f"{info}/entry_points.txt"] = b"[console_scripts]\nrtvtk = rtvtk.__main__:main\n"
    files |= {f"{info}/licenses/{name}": text for name, text in license_files().items()}

    def line(name, data):
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        return f"{name},sha256={digest},{len(data)}"

    record = f"{info}/RECORD"
    files[record] = "\n".join([*(line(n, d) for n, d in files.items()), f"{record},,", ""]).encode()
    name = f"{NAME}-{VERSION}-{tag}.whl"
    with zipfile.ZipFile(os.path.join(wheel_directory, name), "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, data in files.items():
            # One date for all files, so that the same sources give the same wheel.
            entry = zipfile.ZipInfo(path, (2020, 1, 1, 0, 0, 0))
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            wheel.writestr(entry, data)
    return name


def members(found):
    """The members that the library is made of, and their folders, by their manifests."""
    packages = {package["name"]: package for package in found["packages"]}
    wanted, folders = [MEMBER], {}
    while wanted:
        name = wanted.pop()
        folders[name] = pathlib.Path(packages[name]["manifest_path"]).parent
        needs = packages[name]["dependencies"]
        wanted += [d["name"] for d in needs if d.get("path") and d["name"] not in folders]
    return folders


def packages_needed():
    """Names of all packages that the library is built from, or with."""
    listed = cargo("tree", "-p", MEMBER, "--edges", "normal,build", "--prefix", "none", "--format", "{p}", text=True)
    return {line.split()[0] for line in listed.splitlines() if line}


def workspace_manifest(text, folders, needed):
    """The workspace's manifest with these members alone, and the profiles of the packages needed."""
    names = "".join(f'    "{folder}",\n' for folder in folders)
    text, count = re.subn(r"(?m)^members = \[[^\]]*\]", f"members = [\n{names}]", text)
    if count != 1:
        raise SystemExit("the workspace's Cargo.toml has no list of members that can be shortened")
    text = re.sub(r"(?m)^exclude = \[[^\]]*\]\n", "", text)
    # Profiles of packages that are not here would be warned about.

    def kept(section):
        return section[0] if section[1] in needed else ""

    return re.sub(r"(?m)^\[profile\.dev\.package\.([\w-]+)\]\n(?:[^\[\n].*\n|\n)*", kept, text)


def rust_sources():
    """Names in the archive and contents of what cargo needs."""
    found = workspace()
    root = pathlib.Path(found["workspace_root"])
    files, folders = {}, []
    for name, folder in sorted(members(found).items()):
        inside = folder.relative_to(root).as_posix()
        folders.append(inside)
        listed = cargo("package", "-q", "--list", "--allow-dirty", "-p", name, text=True)
        for path in listed.split("\n"):
            file = folder / path
            # Cargo names files too that it would only make.
            if path and file.is_file() and path != "Cargo.lock" and not path.startswith("python/"):
                files[f"{inside}/{path}"] = file.read_bytes()
    manifest = (root / "Cargo.toml").read_text()
    files["Cargo.toml"] = workspace_manifest(manifest, folders, packages_needed()).encode()
    files["Cargo.lock"] = (root / "Cargo.lock").read_bytes()
    return files


def build_sdist(sdist_directory, config_settings=None):
    files = {"PKG-INFO": METADATA.encode(), **license_files()}
    own = [HERE / "pyproject.toml", HERE / "backend.py", *sorted((HERE / NAME).glob("*.py"))]
    files |= {path.relative_to(HERE).as_posix(): path.read_bytes() for path in own}
    files |= rust_sources()
    name = f"{NAME}-{VERSION}.tar.gz"
    with tarfile.open(os.path.join(sdist_directory, name), "w:gz") as archive:
        for path, data in files.items():
            entry = tarfile.TarInfo(f"{NAME}-{VERSION}/{path}")
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
    return name

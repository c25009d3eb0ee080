"""Builds the wheel (PEP 517) with Python's standard library: the package, and the shared library of vtk-bridge.

The library is $RTVTK_LIBRARY, or what `cargo build --release -p vtk-bridge` makes in the workspace of this folder.
"""
import base64
import hashlib
import io
import os
import pathlib
import subprocess
import sysconfig
import tarfile
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
NAME, VERSION = "rtvtk", "0.1.0"
METADATA = f"""Metadata-Version: 2.1
Name: {NAME}
Version: {VERSION}
Summary: Ray tracing inside unmodified VTK scripts, for the stock vtk wheel
Requires-Python: >=3.9
Requires-Dist: vtk>=9.3
Requires-Dist: numpy
License: MIT OR Apache-2.0
"""


def library():
    """The shared library to ship."""
    given = os.environ.get("RTVTK_LIBRARY")
    if given:
        path = pathlib.Path(given)
        if not path.is_file():
            raise SystemExit(f"RTVTK_LIBRARY is {given}, which is no file; leave it out to build the library with cargo")
        return path
    subprocess.run(["cargo", "build", "--release", "-p", "vtk-bridge", "--lib"], cwd=HERE, check=True)
    target = os.environ.get("CARGO_TARGET_DIR") or HERE.parent.parent / "target"
    return pathlib.Path(target) / "release" / "libvtk_bridge.so"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = f"py3-none-{platform}"
    info = f"{NAME}-{VERSION}.dist-info"
    files = {f"{NAME}/{p.name}": p.read_bytes() for p in sorted((HERE / NAME).glob("*.py"))}
    files[f"{NAME}/libvtk_bridge.so"] = library().read_bytes()
    files[f"{info}/METADATA"] = METADATA.encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: rtvtk\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    files[f"{info}/entry_points.txt"] = b"[console_scripts]\nrtvtk = rtvtk.__main__:main\n"

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


def build_sdist(sdist_directory, config_settings=None):
    name = f"{NAME}-{VERSION}.tar.gz"
    with tarfile.open(os.path.join(sdist_directory, name), "w:gz") as archive:
        for path in [HERE / "pyproject.toml", HERE / "backend.py", *sorted((HERE / NAME).glob("*.py"))]:
            archive.add(path, f"{NAME}-{VERSION}/{path.relative_to(HERE)}")
        data = METADATA.encode()
        entry = tarfile.TarInfo(f"{NAME}-{VERSION}/PKG-INFO")
        entry.size = len(data)
        archive.addfile(entry, io.BytesIO(data))
    return name

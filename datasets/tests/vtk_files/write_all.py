"""Writes test files with the real VTK: every kind of data set in every encoding, and what each of them must contain.

    python write_all.py write DIRECTORY     writes the files and DIRECTORY/expected.json
    python write_all.py check FILE ...      reads files with VTK and prints what they contain, as JSON

Needs the module `vtk` (PyPI package vtk, or Debian's python3-vtk9) and numpy.
"""

import json
import os
import sys

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

TYPES = {
    "i8": np.int8, "u8": np.uint8, "i16": np.int16, "u16": np.uint16, "i32": np.int32,
    "u32": np.uint32, "i64": np.int64, "u64": np.uint64, "f32": np.float32, "f64": np.float64,
}


def array(name, values, components=1):
    a = numpy_to_vtk(np.ascontiguousarray(values).reshape(-1, components) if components > 1 else values, deep=True)
    a.SetName(name)
    return a


def add_arrays(data, seed):
    """One array of every type on points and a few on cells; values that show swapped bytes and lost signs."""
    rng = np.random.default_rng(seed)
    n, m = data.GetNumberOfPoints(), data.GetNumberOfCells()
    for name, t in TYPES.items():
        if name.startswith("f"):
            v = rng.normal(size=n) * 1000.0
        else:
            info = np.iinfo(t)
            low, high = max(info.min, -(2**52)), min(info.max, 2**52)
            v = rng.integers(low, high, size=n, endpoint=True)
        data.GetPointData().AddArray(array("p_" + name, v.astype(t)))
    data.GetPointData().AddArray(array("velocity field", rng.normal(size=3 * n).astype(np.float32), 3))
    data.GetPointData().SetScalars(data.GetPointData().GetArray("p_f32"))
    data.GetCellData().AddArray(array("c_f64", rng.normal(size=m)))
    data.GetCellData().AddArray(array("c_u8", np.arange(m).astype(np.uint8)))
    data.GetFieldData().AddArray(array("TimeValue", np.array([1.25])))
    names = vtk.vtkStringArray()
    names.SetName("origin of data")
    for s in ["write_all.py", "two words"]:
        names.InsertNextValue(s)
    data.GetFieldData().AddArray(names)
    return data


def image():
    d = vtk.vtkImageData()
    d.SetExtent(2, 8, -1, 4, 0, 4)
    d.SetOrigin(1.0, 2.0, 3.0)
    d.SetSpacing(0.5, 0.25, 2.0)
    return add_arrays(d, 1)


def rectilinear():
    d = vtk.vtkRectilinearGrid()
    d.SetDimensions(5, 4, 3)
    d.SetXCoordinates(array("x", np.array([0, 1, 3, 4, 8], np.float32)))
    d.SetYCoordinates(array("y", np.array([-1, 0, 2, 5], np.float64)))
    d.SetZCoordinates(array("z", np.array([10, 11, 13], np.float32)))
    return add_arrays(d, 2)


def structured():
    d = vtk.vtkStructuredGrid()
    d.SetDimensions(4, 5, 3)
    p = vtk.vtkPoints()
    p.SetDataTypeToDouble()
    for k in range(3):
        for j in range(5):
            for i in range(4):
                p.InsertNextPoint(1e6 + i + 0.1 * j * j, j - 0.05 * i * k, k + 0.02 * i * j)
    d.SetPoints(p)
    return add_arrays(d, 3)


def poly():
    sphere = vtk.vtkSphereSource()
    sphere.SetThetaResolution(9)
    sphere.SetPhiResolution(7)
    sphere.Update()
    d = vtk.vtkPolyData()
    d.DeepCopy(sphere.GetOutput())
    d.GetPointData().Initialize()
    n = d.GetNumberOfPoints()
    verts, lines, strips = vtk.vtkCellArray(), vtk.vtkCellArray(), vtk.vtkCellArray()
    for ids, cells in [([0], verts), ([1, 2], verts), ([0, 5, 7, 9], lines), ([3, 4], lines), ([1, 2, 3, 4, 5], strips)]:
        cells.InsertNextCell(len(ids))
        for i in ids:
            cells.InsertCellPoint(i)
    d.SetVerts(verts)
    d.SetLines(lines)
    d.SetStrips(strips)
    normals = array("Normals", np.tile([0.0, 0.0, 1.0], n).astype(np.float32), 3)
    d.GetPointData().SetNormals(normals)
    tc = array("uv", np.linspace(0, 1, 2 * n).astype(np.float32), 2)
    d.GetPointData().SetTCoords(tc)
    return add_arrays(d, 4)


def unstructured(polyhedra):
    d = vtk.vtkUnstructuredGrid()
    p = vtk.vtkPoints()
    base = {
        vtk.VTK_TETRA: vtk.vtkTetra(), vtk.VTK_HEXAHEDRON: vtk.vtkHexahedron(), vtk.VTK_VOXEL: vtk.vtkVoxel(),
        vtk.VTK_WEDGE: vtk.vtkWedge(), vtk.VTK_PYRAMID: vtk.vtkPyramid(),
        vtk.VTK_PENTAGONAL_PRISM: vtk.vtkPentagonalPrism(), vtk.VTK_HEXAGONAL_PRISM: vtk.vtkHexagonalPrism(),
        vtk.VTK_QUADRATIC_TETRA: vtk.vtkQuadraticTetra(), vtk.VTK_QUADRATIC_HEXAHEDRON: vtk.vtkQuadraticHexahedron(),
        vtk.VTK_QUADRATIC_WEDGE: vtk.vtkQuadraticWedge(), vtk.VTK_QUADRATIC_PYRAMID: vtk.vtkQuadraticPyramid(),
        vtk.VTK_TRIQUADRATIC_HEXAHEDRON: vtk.vtkTriQuadraticHexahedron(), vtk.VTK_TRIANGLE: vtk.vtkTriangle(),
        vtk.VTK_QUAD: vtk.vtkQuad(), vtk.VTK_PIXEL: vtk.vtkPixel(), vtk.VTK_LINE: vtk.vtkLine(), vtk.VTK_VERTEX: vtk.vtkVertex(),
    }
    cells = []
    for shift, (kind, cell) in enumerate(base.items()):
        c = cell.GetParametricCoords()
        ids = vtk.vtkIdList()
        for i in range(cell.GetNumberOfPoints()):
            ids.InsertNextId(p.InsertNextPoint(c[3 * i] + 2.0 * shift, c[3 * i + 1], c[3 * i + 2]))
        cells.append((kind, ids))
    d.SetPoints(p)
    for kind, ids in cells:
        d.InsertNextCell(kind, ids)
    if polyhedra:
        # A cube as a polyhedron, and a second one on top of it that shares a face.
        first = p.GetNumberOfPoints()
        for z in range(3):
            for y in range(2):
                for x in range(2):
                    p.InsertNextPoint(50.0 + x, y, z)
        for z in range(2):
            b = first + 4 * z
            faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
            stream = vtk.vtkIdList()
            stream.InsertNextId(6)
            for f in faces:
                stream.InsertNextId(4)
                for i in f:
                    stream.InsertNextId(b + i)
            d.InsertNextCell(vtk.VTK_POLYHEDRON, stream)
    return add_arrays(d, 5)


def plain_poly():
    sphere = vtk.vtkSphereSource()
    sphere.SetThetaResolution(9)
    sphere.SetPhiResolution(7)
    sphere.Update()
    d = vtk.vtkPolyData()
    d.DeepCopy(sphere.GetOutput())
    d.GetPointData().Initialize()
    return add_arrays(d, 6)


def plain_unstructured():
    """Voxels, and beside them tetrahedra whose points at the border are their own."""
    image = vtk.vtkImageData()
    image.SetDimensions(5, 4, 4)
    beside = vtk.vtkImageData()
    beside.SetDimensions(3, 4, 4)
    beside.SetOrigin(4, 0, 0)
    tetrahedra = vtk.vtkDataSetTriangleFilter()
    tetrahedra.SetInputData(beside)
    both = vtk.vtkAppendFilter()
    both.AddInputData(image)
    both.AddInputConnection(tetrahedra.GetOutputPort())
    both.Update()
    d = vtk.vtkUnstructuredGrid()
    d.DeepCopy(both.GetOutput())
    return add_arrays(d, 7)


DATA = {
    "vti": ("ImageData", image), "vtr": ("RectilinearGrid", rectilinear), "vts": ("StructuredGrid", structured),
    "vtp": ("PolyData", poly), "vtu": ("UnstructuredGrid", lambda: unstructured(True)),
}


# Of one kind of cells, with names of files that begin with `plain_`.
PLAIN = {"vtp": ("PolyData", plain_poly), "vtu": ("UnstructuredGrid", plain_unstructured)}


def describe(data):
    """What a reader must find."""
    out = {
        "kind": {"vtkStructuredPoints": "ImageData"}.get(data.GetClassName(), data.GetClassName()[3:]),
        "points": data.GetNumberOfPoints(), "cells": data.GetNumberOfCells(), "arrays": {},
    }
    for where, attributes in [("point", data.GetPointData()), ("cell", data.GetCellData()), ("field", data.GetFieldData())]:
        for i in range(attributes.GetNumberOfArrays()):
            a = attributes.GetArray(i)
            if a is None:
                s = attributes.GetAbstractArray(i)
                out["arrays"][where + ":" + s.GetName()] = {"text": [s.GetValue(k) for k in range(s.GetNumberOfValues())]}
                continue
            v = vtk_to_numpy(a).astype(np.float64).ravel()
            weights = np.arange(1, v.size + 1, dtype=np.float64) % 97.0
            out["arrays"][where + ":" + a.GetName()] = {
                "components": a.GetNumberOfComponents(), "values": int(v.size),
                "sum": float(v.sum()), "weighted": float((v * weights).sum()),
                "type": a.GetDataTypeAsString(),
            }
    # Coordinates, and the surface that VTK extracts.
    coordinates = np.array([data.GetPoint(i) for i in range(data.GetNumberOfPoints())])
    if coordinates.size:
        weights = np.arange(1, coordinates.shape[0] + 1, dtype=np.float64) % 97.0
        out["coordinates"] = [float(x) for x in (coordinates * weights[:, None]).sum(axis=0)]
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputData(data)
    surface.SetNonlinearSubdivisionLevel(0)
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputConnection(surface.GetOutputPort())
    triangles.PassLinesOff()
    triangles.PassVertsOff()
    triangles.Update()
    t = triangles.GetOutput()
    out["surface_triangles"] = t.GetNumberOfPolys()
    area = 0.0
    for i in range(t.GetNumberOfCells()):
        c = t.GetCell(i)
        if c.GetCellType() == vtk.VTK_TRIANGLE:
            area += c.ComputeArea()
    out["surface_area"] = area
    out["bounds"] = list(data.GetBounds())
    return out


def set_mode(writer, mode, compressor, header, order):
    if mode == "raw":
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
    elif mode == "appended":
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOn()
    elif mode == "binary":
        writer.SetDataModeToBinary()
    else:
        writer.SetDataModeToAscii()
    writer.SetCompressorType({"none": 0, "zlib": 1, "lz4": 2, "lzma": 3}[compressor])
    (writer.SetHeaderTypeToUInt32 if header == 32 else writer.SetHeaderTypeToUInt64)()
    (writer.SetByteOrderToLittleEndian if order == "le" else writer.SetByteOrderToBigEndian)()
    # Small blocks, so that every array has several and the last is partial.
    writer.SetBlockSize(256)


def write(directory):
    expected = {}

    def note(file, data):
        expected[file] = describe(data)

    # XML: every mode, compressor, header and byte order.
    data_sets = [("", extension, *made) for extension, made in DATA.items()]
    data_sets += [("plain_", extension, *made) for extension, made in PLAIN.items()]
    for prefix, extension, kind, make in data_sets:
        data = make()
        for mode in ["ascii", "binary", "appended", "raw"]:
            for compressor in ["none"] if mode == "ascii" else ["none", "zlib", "lz4", "lzma"]:
                for header in [32, 64]:
                    for order in ["le", "be"]:
                        if (mode == "ascii" or compressor == "lzma") and (header, order) != (64, "le"):
                            continue
                        file = f"{prefix}{mode}_{compressor}_{header}_{order}.{extension}"
                        w = getattr(vtk, f"vtkXML{kind}Writer")()
                        w.SetInputData(data)
                        w.SetFileName(os.path.join(directory, file))
                        set_mode(w, mode, compressor, header, order)
                        w.Write()
                        note(file, data)

    # Parallel pieces.
    for extension, (kind, make) in DATA.items():
        data = make() if extension != "vtu" else unstructured(False)
        if extension == "vtp":
            # VTK's parallel reader (9.7.2) mixes up the cell data of polygons and strips: leave the strips out.
            data.SetStrips(vtk.vtkCellArray())
            for name in ["c_f64", "c_u8"]:
                data.GetCellData().GetArray(name).SetNumberOfTuples(data.GetNumberOfCells())
        file = f"pieces.p{extension}"
        w = getattr(vtk, f"vtkXMLP{kind}Writer")()
        w.SetInputData(data)
        w.SetFileName(os.path.join(directory, file))
        w.SetNumberOfPieces(3)
        w.SetStartPiece(0)
        w.SetEndPiece(2)
        w.Write()
        r = getattr(vtk, f"vtkXMLP{kind}Reader")()
        r.SetFileName(os.path.join(directory, file))
        r.Update()
        note(file, r.GetOutput())

    # Legacy, both versions.
    for extension, (kind, make) in DATA.items():
        for version in [42, 51]:
            data = make() if extension != "vtu" else unstructured(version == 42)
            for mode in ["ascii", "binary"]:
                file = f"legacy_{version}_{mode}_{extension}.vtk"
                legacy = {"ImageData": "StructuredPoints"}.get(kind, kind)
                w = getattr(vtk, f"vtk{legacy}Writer")()
                w.SetInputData(data)
                w.SetFileName(os.path.join(directory, file))
                w.SetFileVersion(version)
                (w.SetFileTypeToASCII if mode == "ascii" else w.SetFileTypeToBinary)()
                w.Write()
                r = getattr(vtk, f"vtk{legacy}Reader")()
                r.SetFileName(os.path.join(directory, file))
                for every in ["Scalars", "Vectors", "Normals", "TCoords", "Fields"]:
                    getattr(r, f"ReadAll{every}On")()
                r.Update()
                note(file, r.GetOutput())

    # A time series and a multi-block file.
    with open(os.path.join(directory, "series.pvd"), "w") as f:
        f.write('<VTKFile type="Collection"><Collection>')
        for t, name in [(2.0, "raw_zlib_64_le.vtp"), (0.5, "ascii_none_64_le.vtp")]:
            f.write(f'<DataSet timestep="{t}" part="0" file="{name}"/>')
        f.write("</Collection></VTKFile>")
    expected["series.pvd"] = expected["ascii_none_64_le.vtp"]
    blocks = vtk.vtkMultiBlockDataSet()
    blocks.SetBlock(0, image())
    blocks.SetBlock(1, poly())
    blocks.GetMetaData(1).Set(vtk.vtkCompositeDataSet.NAME(), "ball")
    w = vtk.vtkXMLMultiBlockDataWriter()
    w.SetInputData(blocks)
    w.SetFileName(os.path.join(directory, "blocks.vtm"))
    w.Write()

    # Meshes and volumes in other formats.
    for name, writer in [("ascii.stl", vtk.vtkSTLWriter()), ("binary.stl", vtk.vtkSTLWriter()),
                         ("ascii.ply", vtk.vtkPLYWriter()), ("binary_le.ply", vtk.vtkPLYWriter()), ("binary_be.ply", vtk.vtkPLYWriter())]:
        sphere = vtk.vtkSphereSource()
        sphere.SetThetaResolution(12)
        sphere.SetPhiResolution(10)
        sphere.Update()
        writer.SetInputData(sphere.GetOutput())
        writer.SetFileName(os.path.join(directory, name))
        (writer.SetFileTypeToASCII if name.startswith("ascii") else writer.SetFileTypeToBinary)()
        if name.endswith("_be.ply"):
            writer.SetDataByteOrderToBigEndian()
        writer.Write()
        d = describe(sphere.GetOutput())
        expected[name] = {k: d[k] for k in ["kind", "surface_triangles", "surface_area", "bounds"]} | {"arrays": {}}
    for name, compress in [("plain.mha", False), ("packed.mha", True), ("two_files.mhd", False)]:
        d = image()
        for i in range(d.GetPointData().GetNumberOfArrays() - 1, -1, -1):
            if d.GetPointData().GetArrayName(i) != "p_i16":
                d.GetPointData().RemoveArray(i)
        d.GetPointData().SetActiveScalars("p_i16")
        w = vtk.vtkMetaImageWriter()
        w.SetInputData(d)
        w.SetFileName(os.path.join(directory, name))
        w.SetCompression(compress)
        w.Write()
        v = vtk_to_numpy(d.GetPointData().GetArray("p_i16")).astype(float)
        weights = np.arange(1, v.size + 1, dtype=np.float64) % 97.0
        stem = name.split(".")[0]
        expected[name] = {"kind": "ImageData", "points": d.GetNumberOfPoints(), "cells": d.GetNumberOfCells(), "bounds": list(d.GetBounds()),
                          "arrays": {"point:" + stem: {"components": 1, "values": int(v.size), "sum": v.sum(), "weighted": (v * weights).sum(), "type": "short"}}}

    with open(os.path.join(directory, "expected.json"), "w") as f:
        json.dump({"vtk": vtk.vtkVersion().GetVTKVersion(), "files": expected}, f, indent=1)


def check(files):
    out = {}
    for file in files:
        extension = file.rsplit(".", 1)[1]
        if extension == "ply":
            r = vtk.vtkPLYReader()
        elif extension == "pvd":
            continue
        else:
            r = getattr(vtk, f"vtkXML{DATA[extension][0]}Reader")()
        failures = []
        r.AddObserver("ErrorEvent", lambda *a: failures.append("error"))
        r.SetFileName(file)
        r.Update()
        out[os.path.basename(file)] = describe(r.GetOutput()) | {"errors": len(failures)}
    print(json.dumps({"vtk": vtk.vtkVersion().GetVTKVersion(), "files": out}))


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "write":
        write(sys.argv[2])
    elif len(sys.argv) > 2 and sys.argv[1] == "check":
        check(sys.argv[2:])
    else:
        sys.exit(__doc__)

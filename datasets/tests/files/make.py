"""Writes the small files that the tests read, with h5py, netCDF4 and VTK. Run it in this folder."""
import h5py
import netCDF4
import numpy as np


def counted(shape, dtype="f8"):
    """Element i is i % 100."""
    return (np.arange(int(np.prod(shape))) % 100).reshape(shape).astype(dtype)


def hdf5(name, libver):
    with h5py.File(name, "w", libver=libver) as f:
        f["contiguous"] = counted((5, 7))
        f["big"] = counted((3, 4), ">i2")
        f["big float"] = counted((3, 4), ">f4")
        f["scalar"] = np.float32(0)
        f.create_dataset("chunked", data=counted((9, 11), "i4"), chunks=(4, 3))
        f.create_dataset("filtered", data=counted((20, 30), "f4"), chunks=(6, 7),
                         compression="gzip", shuffle=True, fletcher32=True)
        f.create_dataset("one chunk", data=counted((6, 7)), chunks=(6, 7), compression="gzip")
        f.create_dataset("enumerated", data=counted((2, 3), "i1"),
                         dtype=h5py.enum_dtype({"a": 0, "b": 1}, basetype="i1"))
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_layout(h5py.h5d.COMPACT)
        space = h5py.h5s.create_simple((3, 5))
        d = h5py.h5d.create(f.id, b"compact", h5py.h5t.IEEE_F64LE, space, plist)
        d.write(h5py.h5s.ALL, h5py.h5s.ALL, counted((3, 5)))
        if libver == "latest":
            f.create_dataset("growing twice", data=counted((12, 13), "i8"), chunks=(5, 4),
                             maxshape=(None, None))
            f.create_dataset("growing", data=counted((50, 3), "u1"), chunks=(1, 2),
                             maxshape=(None, 3))
            f.create_dataset("growing across", data=counted((3, 40), "u2"), chunks=(2, 1),
                             maxshape=(3, None), compression="gzip")
            plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            plist.set_chunk((2, 4))
            plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
            space = h5py.h5s.create_simple((5, 6))
            d = h5py.h5d.create(f.id, b"implicit", h5py.h5t.STD_I32LE, space, plist)
            d.write(h5py.h5s.ALL, h5py.h5s.ALL, counted((5, 6), "i4"))
            g = f.create_group("refused")
            g.create_dataset("lzf", data=counted((4, 4)), compression="lzf", chunks=(4, 4))
            g["compound"] = np.zeros(2, dtype=[("a", "i4"), ("b", "f8")])
            g["half"] = counted((3,), "f2")
            layout = h5py.VirtualLayout(shape=(4,), dtype="f8")
            layout[:] = h5py.VirtualSource("other.h5", "x", shape=(4,))
            g.create_virtual_dataset("virtual", layout)
        for count in (3, 20):
            g = f.create_group(f"group of {count}")
            for i in range(count):
                g[f"member {i}"] = f["one chunk"]
                g.attrs[f"attribute {i}"] = np.array([i, 0.5])
        t = f.create_group("texts")
        t.attrs["fixed"] = np.bytes_("m/s")
        t.attrs["variable"] = "ümlaut"
        t.attrs["list"] = np.array(["a", "", "bc"], dtype=h5py.string_dtype())
        f["soft"] = h5py.SoftLink("/group of 3")
        f["elsewhere"] = h5py.ExternalLink("other.h5", "/x")


def image(name, times):
    """Image data of VTKHDF; with times, the point data grow and the cell data stay."""
    with h5py.File(name, "w") as f:
        g = f.create_group("VTKHDF")
        g.attrs["Version"] = [2, 0]
        g.attrs.create("Type", b"ImageData", dtype=h5py.string_dtype("ascii", 9))
        g.attrs["WholeExtent"] = [0, 3, 1, 3, 0, 1]
        g.attrs["Origin"], g.attrs["Spacing"] = [1.0, -2.0, 0.5], [0.5, 1.0, 2.0]
        g.attrs["Direction"] = np.eye(3).ravel()
        p, c = g.create_group("PointData"), g.create_group("CellData")
        rho = counted((2, 3, 4), "f4")
        if times:
            rho = np.stack([rho + 100 * i for i in range(len(times))])
            s = g.create_group("Steps")
            s.attrs["NSteps"] = len(times)
            s["Values"] = np.array(times)
            s["PointDataOffsets/rho"] = np.arange(len(times))
            s["CellDataOffsets/c"] = np.zeros(len(times), "i8")
        p["rho"] = rho
        p["rho"].attrs["Attribute"] = np.bytes_("Scalars")
        c["c"] = counted((1, 1, 2, 3, 2), "u1") if times else counted((1, 2, 3, 2), "u1")
        g["FieldData/gamma"] = np.array([1.4])


def netcdf(name, form):
    """Two times on 4 x 3 x 2 points: packed temperatures in degrees C, and densities."""
    with netCDF4.Dataset(name, "w", format=form) as f:
        f.createDimension("time", None)
        for axis, x in dict(x=[1, 2, 3, 4], y=[0, 10, 20], z=[0, 5]).items():
            f.createDimension(axis, len(x))
            v = f.createVariable(axis, "f4", (axis,))
            v.units, v[:] = "mm", x
        t = f.createVariable("time", "f8", ("time",))
        t.units, t[:] = "seconds since 2020-01-01", [0.25, 0.5]
        v = f.createVariable("T", "i2", ("time", "z", "y", "x"), fill_value=-999)
        v.set_auto_maskandscale(False)
        v.scale_factor, v.add_offset, v.units = 0.5, 20.0, "degC"
        v[0] = counted((2, 3, 4), "i2")
        v[1] = counted((2, 3, 4), "i2") + 100
        v[1, 0, 0, 2] = -999
        v = f.createVariable("rho", "f8", ("time", "z", "y", "x"))
        v[0], v[1] = counted((2, 3, 4)), counted((2, 3, 4)) + 100
        v = f.createVariable("static", "f4", ("x", "y", "z"))
        v[:] = counted((4, 3, 2))
        v = f.createVariable("line", "f4", ("x",))
        v[:] = 1


def exodus(name, form):
    """A hexahedron and two tetrahedra in blocks 10 and 20, with two times."""
    with netCDF4.Dataset(name, "w", format=form) as f:
        f.api_version, f.version = np.float32(5.1), np.float32(5.1)
        f.floating_point_word_size, f.file_size, f.title = 8, 1, "two blocks"
        for dim, n in dict(time_step=None, len_string=33, len_name=33, num_dim=3, num_nodes=9,
                           num_elem=3, num_el_blk=2, num_el_in_blk1=1, num_nod_per_el1=8,
                           num_el_in_blk2=2, num_nod_per_el2=4, num_nod_var=2,
                           num_elem_var=1).items():
            f.createDimension(dim, 2 if dim == "time_step" and form == "NETCDF4" else n)
        t = f.createVariable("time_whole", "f8", ("time_step",))
        t[:] = [0.0, 0.5]
        f.createVariable("eb_status", "i4", ("num_el_blk",))[:] = 1
        ids = f.createVariable("eb_prop1", "i4", ("num_el_blk",))
        ids.setncattr("name", "ID")
        ids[:] = [10, 20]
        corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1],
                            [1, 1, 1], [0, 1, 1], [2, 0, 0.5]])
        for axis, x in zip("xyz", corners.T):
            f.createVariable(f"coord{axis}", "f8", ("num_nodes",))[:] = x
        c = f.createVariable("connect1", "i4", ("num_el_in_blk1", "num_nod_per_el1"))
        c.elem_type, c[:] = "HEX8", [[1, 2, 3, 4, 5, 6, 7, 8]]
        c = f.createVariable("connect2", "i4", ("num_el_in_blk2", "num_nod_per_el2"))
        c.elem_type, c[:] = "TETRA", [[2, 3, 7, 9], [2, 6, 7, 9]]
        for dim, names in (("num_nod_var", ["T", "p"]), ("num_elem_var", ["c"]),
                           ("num_el_blk", ["cube", "side"])):
            variable = {"num_nod_var": "name_nod_var", "num_elem_var": "name_elem_var"}
            v = f.createVariable(variable.get(dim, "eb_names"), "S1", (dim, "len_name"))
            v[:] = np.array([[*n.ljust(33, "\0")] for n in names], "S1")
        f.createVariable("elem_var_tab", "i4", ("num_el_blk", "num_elem_var"))[:] = [[1], [0]]
        for i in range(2):
            v = f.createVariable(f"vals_nod_var{i + 1}", "f8", ("time_step", "num_nodes"))
            v[0], v[1] = np.arange(9) + 10 * i, np.arange(9) + 10 * i + 100
        v = f.createVariable("vals_elem_var1eb1", "f8", ("time_step", "num_el_in_blk1"))
        v[0], v[1] = [7.0], [8.0]


class Cgns:
    """A CGNS file, as the library maps it to HDF5: a group with name, label and type for each
    node, and its values in the dataset ` data`."""

    TYPES = {"i4": "I4", "i8": "I8", "f4": "R4", "f8": "R8", "i1": "C1"}

    def __init__(self, name):
        # The library writes groups with an order, attributes of 33 characters, and HDF5 of 1.8.
        self.file = h5py.File(name, "w", libver=("v108", "v108"), track_order=True)
        self.node("CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([4.4], "f4"))

    def node(self, path, label, values=None):
        g = self.file.create_group(path, track_order=True)
        if isinstance(values, str):
            values = np.frombuffer(values.encode(), "i1")
        kind = "MT" if values is None else self.TYPES[values.dtype.str[1:]]
        self.attributes(g, path, label, kind)
        if values is not None:
            g[" data"] = values

    def attributes(self, g, path, label, kind):
        g.attrs["name"] = np.array(path.split("/")[-1].encode(), "S33")
        g.attrs["label"] = np.array(label.encode(), "S33")
        g.attrs["type"] = np.array(kind.encode(), "S3")

    def link(self, path, to, file=""):
        g = self.file.create_group(path, track_order=True)
        self.attributes(g, path, "", "LK")
        g[" path"] = np.frombuffer(to.encode() + b"\0", "i1")
        if file:
            g[" file"] = np.frombuffer(file.encode() + b"\0", "i1")
        g[" link"] = h5py.ExternalLink(file, to) if file else h5py.SoftLink(to)

    def names(self, path, label, names):
        """Names of 32 characters each."""
        text = "".join(n.ljust(32) for n in names).encode()
        self.node(path, label, np.frombuffer(text, "i1").reshape(len(names), 32))

    def zone(self, path, sizes, points, kind="Structured", dtype="f8"):
        self.node(path, "Zone_t", np.array(sizes, "i4"))
        self.node(f"{path}/ZoneType", "ZoneType_t", kind)
        self.node(f"{path}/GridCoordinates", "GridCoordinates_t")
        for axis, x in zip("XYZ", points):
            self.node(f"{path}/GridCoordinates/Coordinate{axis}", "DataArray_t", x.astype(dtype))

    def section(self, path, kind, elements, first, **arrays):
        """A section whose elements are numbered from `first`."""
        self.node(path, "Elements_t", np.array([kind, 0], "i4"))
        count = len(arrays.get("ElementStartOffset", range(len(elements) + 1))) - 1
        count = arrays.pop("count", count)
        self.node(f"{path}/ElementRange", "IndexRange_t",
                  np.array([first, first + count - 1], "i4"))
        flat = np.concatenate([np.ravel(e) for e in elements]).astype("i4")
        self.node(f"{path}/ElementConnectivity", "DataArray_t", flat)
        for name, values in arrays.items():
            self.node(f"{path}/{name}", "DataArray_t", np.array(values, "i4"))


def cgns_zones(name):
    """Two structured zones with rind planes, units and two times."""
    f = Cgns(name)
    f.node("Base", "CGNSBase_t", np.array([3, 3], "i4"))
    f.node("Base/DataClass", "DataClass_t", "Dimensional")
    f.names("Base/DimensionalUnits", "DimensionalUnits_t",
            ["Gram", "Centimeter", "Second", "Celsius", "Radian"])
    f.node("Base/Times", "BaseIterativeData_t", np.array([2], "i4"))
    f.node("Base/Times/TimeValues", "DataArray_t", np.array([0.25, 0.5]))
    for zone, shift in (("left", 0), ("right", 3)):
        path = f"Base/{zone}"
        z, y, x = np.mgrid[0:2, 0:3, 0:4] * 1.0
        f.zone(path, [[4, 3, 2], [3, 2, 1], [0, 0, 0]], [x + shift, y, z], dtype="f4")
        for step in range(2):
            # A plane before i and two behind j have values that do not belong to the zone.
            p = np.full((1, 4, 4), -1.0)
            p[:, :2, 1:] = counted((1, 2, 3)) + 100 * step
            solution = f"{path}/Solution{step}"
            f.node(solution, "FlowSolution_t")
            f.node(f"{solution}/GridLocation", "GridLocation_t", "CellCenter")
            f.node(f"{solution}/Rind", "Rind_t", np.array([1, 0, 0, 2, 0, 0], "i4"))
            f.node(f"{solution}/Pressure", "DataArray_t", p)
        f.node(f"{path}/AtVertices", "FlowSolution_t")
        f.node(f"{path}/AtVertices/Temperature", "DataArray_t", counted((2, 3, 4), "f4"))
        f.node(f"{path}/Steps", "ZoneIterativeData_t")
        f.names(f"{path}/Steps/FlowSolutionPointers", "DataArray_t", ["Solution0", "Solution1"])


CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1],
                 [0, 1, 1]], "f8")


def cgns_elements(name):
    """Zones of elements: several kinds with a boundary, cubic ones, and polyhedra."""
    f = Cgns(name)
    f.node("Base", "CGNSBase_t", np.array([3, 3], "i4"))
    # A hexahedron, a wedge and a pyramid, mixed; a tetrahedron; a quad of the boundary.
    points = np.vstack([CUBE, [[2, 0, 0], [2, 0, 1], [0.5, 2, 0.5], [3, 0, 0], [2, 1, 0]]])
    f.zone("Base/mixed", [[13], [4], [0]], points.T, "Unstructured")
    mixed = [[17, 1, 2, 3, 4, 5, 6, 7, 8], [14, 2, 9, 3, 6, 10, 7], [12, 3, 4, 8, 7, 11]]
    f.section("Base/mixed/Solids", 20, mixed, 1, ElementStartOffset=[0, 9, 16, 22])
    f.section("Base/mixed/Wall", 7, [[1, 2, 6, 5]], 4)
    f.section("Base/mixed/Tetra", 10, [[9, 12, 13, 10]], 5)
    f.node("Base/mixed/Flow", "FlowSolution_t")
    f.node("Base/mixed/Flow/GridLocation", "GridLocation_t", "CellCenter")
    f.node("Base/mixed/Flow/Density", "DataArray_t", counted((4,)))
    # A quadratic and a cubic hexahedron at the same corners, beside each other.
    middles = [(CUBE[a] + CUBE[b]) / 2 for a, b in
               [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6),
                (6, 7), (7, 4)]]
    points = np.vstack([CUBE, middles, CUBE + [2, 0, 0], np.tile(CUBE[:1], (24, 1))])
    f.zone("Base/curved", [[52], [2], [0]], points.T, "Unstructured")
    f.section("Base/curved/Quadratic", 18, [range(1, 21)], 1)
    f.section("Base/curved/Cubic", 37, [range(21, 53)], 2)
    # A cube, and a cube of which an edge of the top is cut into two: by faces.
    points = np.vstack([CUBE, CUBE[[1, 2, 5, 6]] + [1, 0, 0], [[2, 0.5, 1]]])
    f.zone("Base/polyhedra", [[13], [2], [0]], points.T, "Unstructured")
    faces = [[2, 3, 7, 6], [1, 5, 8, 4], [1, 2, 6, 5], [4, 8, 7, 3], [1, 4, 3, 2], [5, 6, 7, 8],
             [9, 10, 12, 13, 11], [2, 9, 11, 6], [3, 7, 12, 10], [2, 3, 10, 9],
             [6, 11, 13, 12, 7]]
    starts = np.cumsum([0] + [len(x) for x in faces])
    f.section("Base/polyhedra/Faces", 22, faces, 1, ElementStartOffset=starts)
    f.section("Base/polyhedra/Cells", 23, [[1, 2, 3, 4, 5, 6], [-1, 7, 8, 9, 10, 11]], 12,
              ElementStartOffset=[0, 6, 12])


def cgns_links(name):
    """A zone that is that of another file, under another name, and a link within the file."""
    f = Cgns(name)
    f.node("Base", "CGNSBase_t", np.array([3, 3], "i4"))
    f.link("Base/linked", "/Base/mixed", "elements.cgns")
    f.link("Base/again", "/Base/linked")


def cgns_walls(name):
    """Zones with boundary conditions: of ranges, lists, faces, elements and families."""
    f = Cgns(name)
    f.node("Base", "CGNSBase_t", np.array([3, 3], "i4"))
    f.node("Base/Body", "Family_t")
    f.node("Base/Body/FamilyBC", "FamilyBC_t", "BCWallViscous")
    f.node("Base/Far", "Family_t")
    f.node("Base/Far/FamilyBC", "FamilyBC_t", "BCFarfield")

    def condition(path, kind, indices, label="PointRange", location=None, family=None):
        f.node(path, "BC_t", kind)
        is_range = label.endswith("Range")
        f.node(f"{path}/{label}", "IndexRange_t" if is_range else "IndexArray_t",
               np.array(indices, "i4"))
        if location:
            f.node(f"{path}/GridLocation", "GridLocation_t", location)
        if family:
            f.node(f"{path}/FamilyName", "FamilyName_t", family)

    z, y, x = np.mgrid[0:2, 0:3, 0:4] * 1.0
    # The plane j = 1 by points, the plane i = 4 by faces, and a far field.
    f.zone("Base/lattice", [[4, 3, 2], [3, 2, 1], [0, 0, 0]], [x, y, z])
    f.node("Base/lattice/ZoneBC", "ZoneBC_t")
    bc = "Base/lattice/ZoneBC"
    condition(f"{bc}/floor", "BCWallInviscid", [[1, 1, 1], [4, 1, 2]])
    condition(f"{bc}/side", "FamilySpecified", [[4, 1, 1], [4, 2, 1]], location="IFaceCenter",
              family="Body")
    condition(f"{bc}/far", "FamilySpecified", [[1, 1, 1], [1, 3, 2]], family="Far")
    # A hexahedron with its bottom and its side at x = 1 as elements; the bottom is a wall.
    f.zone("Base/elements", [[8], [1], [0]], CUBE.T, "Unstructured")
    f.section("Base/elements/Solids", 17, [[1, 2, 3, 4, 5, 6, 7, 8]], 1)
    f.section("Base/elements/Border", 7, [[1, 4, 3, 2], [2, 3, 7, 6]], 2)
    f.node("Base/elements/ZoneBC", "ZoneBC_t")
    bc = "Base/elements/ZoneBC"
    condition(f"{bc}/bottom", "BCWall", [[2, 2]], location="FaceCenter")
    condition(f"{bc}/outlet", "BCOutflow", [[3]], "PointList", location="FaceCenter")
    # By points, with a name alone, and a number that no point has.
    f.zone("Base/points", [[8], [1], [0]], (CUBE + [0, 0, 5]).T, "Unstructured")
    f.section("Base/points/Solids", 17, [[1, 2, 3, 4, 5, 6, 7, 8]], 1)
    f.node("Base/points/ZoneBC", "ZoneBC_t")
    condition("Base/points/ZoneBC/wing", "UserDefined", [[5, 99]], "PointList")
    # A range far beyond the points, and faces that no section has.
    condition("Base/points/ZoneBC/long", "BCWall", [[7, 2000000000]])
    condition("Base/points/ZoneBC/gone", "BCWall", [[70, 80]], location="FaceCenter")
    # Names and types that say nothing.
    f.zone("Base/unknown", [[8], [1], [0]], (CUBE + [0, 0, 9]).T, "Unstructured")
    f.section("Base/unknown/Solids", 17, [[1, 2, 3, 4, 5, 6, 7, 8]], 1)
    f.node("Base/unknown/ZoneBC", "ZoneBC_t")
    condition("Base/unknown/ZoneBC/part 7", "Null", [[1, 2]], "PointList")


if __name__ == "__main__":
    cgns_walls("walls.cgns")
    cgns_zones("zones.cgns")
    cgns_elements("elements.cgns")
    cgns_links("links.cgns")
    exodus("offset.exo", "NETCDF3_64BIT_OFFSET")
    exodus("netcdf4.exo", "NETCDF4")
    image("image.vtkhdf", [])
    image("times.vtkhdf", [0.0, 0.5, 2.0])
    netcdf("classic.nc", "NETCDF3_CLASSIC")
    netcdf("offset.nc", "NETCDF3_64BIT_OFFSET")
    netcdf("data.nc", "NETCDF3_64BIT_DATA")
    netcdf("netcdf4.nc", "NETCDF4")
    hdf5("old.h5", "earliest")
    hdf5("new.h5", "latest")

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


if __name__ == "__main__":
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

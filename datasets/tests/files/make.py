"""Writes the small files that the tests read, with h5py, netCDF4 and VTK. Run it in this folder."""
import h5py
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
        f.create_dataset("growing twice", data=counted((12, 13), "i8"), chunks=(5, 4),
                         maxshape=(None, None))
        f.create_dataset("enumerated", data=counted((2, 3), "i1"),
                         dtype=h5py.enum_dtype({"a": 0, "b": 1}, basetype="i1"))
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_layout(h5py.h5d.COMPACT)
        space = h5py.h5s.create_simple((3, 5))
        d = h5py.h5d.create(f.id, b"compact", h5py.h5t.IEEE_F64LE, space, plist)
        d.write(h5py.h5s.ALL, h5py.h5s.ALL, counted((3, 5)))
        if libver == "latest":
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


if __name__ == "__main__":
    hdf5("old.h5", "earliest")
    hdf5("new.h5", "latest")

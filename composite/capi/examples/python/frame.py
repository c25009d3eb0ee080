"""Ranks of MPI composite images that they have drawn, and render a scene that none has whole.

mpirun -n 4 python frame.py OUT [GROUPS]; rank 0 of each group writes OUT-GROUP.depth, .alpha,
.picture (raw RGBA: bytes, floats, floats).
"""

import sys
from ctypes import byref, c_uint32, c_void_p, memmove, sizeof

import numpy as np
import rtsv_composite as rc
from mpi4py import MPI

WIDTH, HEIGHT = 96, 64


def array(values, kind):
    """A description of a numpy array; the caller keeps the array while the library reads it."""
    return rc.Array(data=values.ctypes.data, count=values.shape[0], components=values.shape[1],
                    kind=kind, stride_bytes=values.strides[0])


def save(group, end, data, shape, dtype):
    if data:  # Only one rank has the image.
        image = np.empty(shape, dtype)
        memmove(image.ctypes.data, data, image.nbytes)
        image.tofile(f"{sys.argv[1]}-{group}.{end}")


def draw(rank):
    """A chequered board of each rank, in bytes with depth and in floats with an alpha of 1/4."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    drawn = ((x + 5 * rank) // 16 + y // 16) % 2 == 0
    channels = np.stack([0 * x + (60 * rank + 40) % 256, 2 * x, 3 * y, 0 * x + 256], axis=-1)
    channels[~drawn] = 0
    depth = np.where(drawn, (x + 3 * y + 17 * rank) % 64 / 64, 1).astype(np.float32)
    color = np.minimum(channels, 255).astype(np.uint8)
    return color, depth, (channels / 1024).astype(np.float32)


def composite(comm, kind, color, depth, group, end):
    compositor = c_void_p()
    rc.compositor_new(comm, kind, None, byref(compositor))
    frame = rc.Frame(width=WIDTH, height=HEIGHT)
    frame.color.data = color.ctypes.data
    frame.depth.data = None if depth is None else depth.ctypes.data
    image = rc.Image()
    rc.composite(compositor, byref(frame), byref(image))
    save(group, end, image.color, color.shape, color.dtype)
    rc.compositor_free(compositor)


def main():
    groups = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    group = MPI.COMM_WORLD.rank % groups
    ours = MPI.COMM_WORLD.Split(group)
    comm, rank, ranks = c_void_p(), c_uint32(), c_uint32()
    rc.comm_from_mpi(MPI._addressof(ours), MPI._sizeof(MPI.Comm), byref(comm))
    rc.comm_rank(comm, byref(rank), byref(ranks))
    rank, ranks = rank.value, ranks.value

    # Buffers in, image out.
    color, depth, blended = draw(rank)
    composite(comm, rc.DEPTH_U8, color, depth, group, "depth")
    composite(comm, rc.ALPHA_F32, blended, None, group, "alpha")

    # A scene: each rank has a strip of the ground and a ball whose shadow leaves the strip.
    scene = c_void_p()
    rc.scene_new(byref(scene))
    material, light = rc.Material(), rc.Light()
    rc.material_init(byref(material), sizeof(material))
    rc.scene_material(scene, byref(material), None)
    rc.light_init(byref(light), sizeof(light))
    light.color[:] = [0.25] * 3
    rc.scene_light(scene, byref(light))
    light.kind = rc.DIRECTIONAL
    light.direction[:] = [-1, -0.5, 1]
    light.color[:] = [0.75] * 3
    rc.scene_light(scene, byref(light))

    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 4, 0], [0, 4, 0]], np.float32)
    corners[:, 0] += rank
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    mesh = rc.Mesh(name=b"ground", positions=array(corners, rc.F32),
                   triangles=array(triangles, rc.U32))
    rc.scene_mesh(scene, byref(mesh))
    center = np.array([[rank + 0.5, 1.5 + rank % 3 * 0.5, 0.75]])
    tint = np.array([[rank % 2, 0.5, 1 - rank % 2, 1]], np.float32)
    balls = rc.Spheres(name=b"balls", radius=0.5, centers=array(center, rc.F64),
                       colors=array(tint, rc.F32))
    rc.scene_spheres(scene, byref(balls))

    renderer, view, picture = c_void_p(), rc.View(), rc.Picture()
    rc.renderer_new(comm, scene, None, byref(renderer))
    rc.view_init(byref(view), sizeof(view))
    view.width, view.height = 320, 200
    view.eye[:] = [0.5 * ranks, -0.625 * ranks, 0.5 * ranks]
    view.target[:] = [0.5 * ranks, 2, 0]
    view.up[:] = [0, 0, 1]
    rc.renderer_render(renderer, byref(view), byref(picture))
    save(group, "picture", picture.color, (picture.height, picture.width, 4), np.float32)

    rc.renderer_free(renderer)
    rc.scene_free(scene)
    rc.comm_free(comm)
    ours.Free()


main()

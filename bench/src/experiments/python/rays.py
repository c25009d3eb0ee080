"""Times ray queries of Python packages in turns.

A line of JSON in, and lines out. In: {"rings": [...], "rays": [...], "rounds": n, "folder": path}.
Out: questions for the parent, which answers each with a line (see FromRust), then versions, what is
missing, and for each mesh, kind and number of rays the seconds of each package in each round.

In a turn, a package answers the same call again and again for a tenth of a second, after one that
does not count: programs ask the same scene many times, and a first call finds the caches as another
package left them. Packages pause before their turns, until the threads of the last one sleep.
"""

import ctypes
import importlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np


def mesh(rings):
    """A closed, uneven ball of about 4 * rings**2 triangles."""
    n = 2 * rings
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.arange(n) * (2 * np.pi / n)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    radius = 1 + 0.1 * np.sin(7 * t) * np.cos(5 * p)
    body = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    body = (body * radius[..., None]).reshape(-1, 3)
    vertices = np.concatenate([body, [[0, 0, 1], [0, 0, -1]]]).astype(np.float32)
    a = (np.arange(rings - 2)[:, None] * n + np.arange(n)).ravel()
    b = (np.arange(rings - 2)[:, None] * n + (np.arange(n) + 1) % n).ravel()
    sides = [np.stack([a, a + n, b + n], 1), np.stack([a, b + n, b], 1)]
    k, last = np.arange(n), (rings - 2) * n
    top = np.stack([np.full(n, len(body)), k, (k + 1) % n], 1)
    bottom = np.stack([last + k, np.full(n, len(body) + 1), last + (k + 1) % n], 1)
    return vertices, np.concatenate([*sides, top, bottom]).astype(np.uint32)


def rays(count):
    rng = np.random.default_rng(1)
    origins = rng.normal(size=(count, 3))
    origins *= 3 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-1.1, 1.1, size=(count, 3)) - origins
    return origins.astype(np.float32), directions.astype(np.float32)


def edge_rays(vertices, triangles, count, rng):
    """Rays from inside a closed mesh to its vertices, and to points on its edges."""
    corners = triangles[rng.integers(0, len(triangles), count)]
    start, end = vertices[corners[:, 0]], vertices[corners[:, 1]]
    along = rng.random((count, 1), dtype=np.float32)
    along[::4] = 0
    origins = rng.uniform(-0.3, 0.3, size=(count, 3)).astype(np.float32)
    return origins, start + along * (end - start) - origins


#: Seconds of calls that make a turn.
TURN = 0.1
#: Calls that take longer have no call before them in a turn.
LONG = 0.5
#: Seconds between two turns.
PAUSE = 0.02
#: Rays to edges in a call.
EDGE_RAYS = 1_000_000


class RtCore:
    name, module, most = "rt_core", "rt_core", None

    def __init__(self, vertices, triangles):
        import rt_core

        self.scene = rt_core.Scene(vertices, triangles)

    def first(self, origins, directions):
        return int(self.scene.cast(origins, directions).hit.sum())

    def all(self, origins, directions):
        return len(self.scene.all_hits(origins, directions).t)


class FromRust:
    """The same call by a program in Rust: the parent, which measures its own calls."""

    name, module, most = "rt_core from Rust", "rt_core", None
    kind = "arrays"

    def __init__(self, vertices, triangles):
        self.ask({"mesh": {"vertices": FOLDER.keep(vertices), "triangles": FOLDER.keep(triangles)}})

    @staticmethod
    def ask(question):
        print(json.dumps({"question": question}), flush=True)
        return json.loads(sys.stdin.readline())

    def turn(self, kind, origins, directions):
        """Seconds of a call, and what it found."""
        rays = {"origins": FOLDER.keep(origins), "directions": FOLDER.keep(directions)}
        turn = {"from": self.kind, "turn_seconds": TURN, "long_seconds": LONG}
        answer = self.ask({"first": rays | turn})
        return answer["seconds"], answer["found"]


class TracingAlone(FromRust):
    """Only the traversal, of rays that are in blocks already."""

    name, kind = "rt_core from Rust, traversal alone", "blocks"


class Folder:
    """Where arrays lie for the parent to read."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        self.kept = {}

    def keep(self, array):
        if id(array) not in self.kept:
            place = self.path / f"{len(self.kept)}.bin"
            array.tofile(place)
            # The array is kept too, so that no other gets its number.
            self.kept[id(array)] = (str(place), array)
        return self.kept[id(array)][0]

    def clear(self):
        for place, _ in self.kept.values():
            os.remove(place)
        self.kept = {}


class TrimeshRtCore:
    name, module, most = "trimesh with rt_core", "trimesh", None

    def __init__(self, vertices, triangles):
        import trimesh

        self.mesh = trimesh.Trimesh(vertices, triangles, process=False)
        self.ray = self.tracer()(self.mesh)
        self.ray.intersects_any([[0, 0, 9]], [[0, 0, 1]])

    @staticmethod
    def tracer():
        from rt_core.trimesh import RayMeshIntersector

        return RayMeshIntersector

    def first(self, origins, directions):
        return int((self.ray.intersects_first(origins, directions) >= 0).sum())

    def all(self, origins, directions):
        return len(self.ray.intersects_id(origins, directions)[0])


class TrimeshEmbree(TrimeshRtCore):
    name, module = "trimesh with embreex", "embreex"

    @staticmethod
    def tracer():
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        return RayMeshIntersector


class Open3D:
    name, module, most = "Open3D", "open3d", None

    def __init__(self, vertices, triangles):
        import open3d

        self.wrap = open3d.core.Tensor
        self.scene = open3d.t.geometry.RaycastingScene()
        self.scene.add_triangles(self.wrap(vertices), self.wrap(triangles))
        self.first(np.float32([[0, 0, 9]]), np.float32([[0, 0, 1]]))

    def rows(self, origins, directions):
        return self.wrap(np.concatenate([origins, directions], axis=1))

    def first(self, origins, directions):
        hits = self.scene.cast_rays(self.rows(origins, directions))
        return int(np.isfinite(hits["t_hit"].numpy()).sum())

    def all(self, origins, directions):
        return len(self.scene.list_intersections(self.rows(origins, directions))["t_hit"])


class PyVista:
    # One segment a call.
    name, module, most = "PyVista", "pyvista", 1000

    def __init__(self, vertices, triangles):
        import pyvista

        self.mesh = pyvista.PolyData.from_regular_faces(vertices, triangles)
        self.mesh.ray_trace([0, 0, 9], [0, 0, 10])

    def first(self, origins, directions):
        ends = origins + 3 * directions
        return sum(len(self.mesh.ray_trace(o, e)[1]) > 0 for o, e in zip(origins, ends))

    def all(self, origins, directions):
        ends = origins + 3 * directions
        return sum(len(self.mesh.ray_trace(o, e)[1]) for o, e in zip(origins, ends))


class ObbTree:
    """What PyVista traced with before 0.49."""

    name, module, most = "VTK OBB tree", "pyvista", 1000
    # Building takes a second for a million.
    most_triangles = 1_100_000

    def __init__(self, vertices, triangles):
        import pyvista
        import vtk

        self.mesh = pyvista.PolyData.from_regular_faces(vertices, triangles)
        self.tree = vtk.vtkOBBTree()
        self.tree.SetDataSet(self.mesh)
        self.tree.BuildLocator()
        self.points = vtk.vtkPoints()

    def crossings(self, origins, directions):
        ends = origins + 3 * directions
        for start, end in zip(origins.tolist(), ends.tolist()):
            self.tree.IntersectWithLine(start, end, self.points, None)
            yield self.points.GetNumberOfPoints()

    def first(self, origins, directions):
        return sum(count > 0 for count in self.crossings(origins, directions))

    def all(self, origins, directions):
        return sum(self.crossings(origins, directions))


IMPORT = "import time, numpy; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"


def import_seconds(module):
    """Seconds that an import takes beyond numpy's, in a process of its own."""
    return float(subprocess.check_output([sys.executable, "-c", IMPORT.format(module)]))


def stop_seconds(call):
    """Seconds from Ctrl-C to the end of a long call."""
    pressed = []

    def press():
        pressed.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.2, press)
    try:
        timer.start()
        while True:
            call()
    except KeyboardInterrupt:
        seconds = time.perf_counter() - pressed[0]
    timer.join()
    return seconds


TRACERS = (
    RtCore, FromRust, TracingAlone, TrimeshRtCore, TrimeshEmbree, Open3D, PyVista, ObbTree
)  # fmt: skip
#: Of this process: bytes in memory, and the most that there were.
RESIDENT, PEAK = "VmRSS", "VmHWM"


def of_process(name):
    with open("/proc/self/status") as file:
        line = next(line for line in file if line.startswith(name + ":"))
    return 1024 * int(line.split()[1])


def reset_peak():
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")


def print_memory(name, rings):
    """In a process of its own: what a package holds of a mesh, and most while it builds, beyond the
    arrays and what the package is without a mesh."""
    tracer = next(t for t in TRACERS if t.name == name)
    # Everything that a package loads at its first use.
    small = tracer(*mesh(3))
    arrays = mesh(rings)
    # What the arrays' making has freed would hide growth.
    ctypes.CDLL(None).malloc_trim(0)
    reset_peak()
    before = of_process(RESIDENT)
    built = tracer(*arrays)
    print(json.dumps([of_process(RESIDENT) - before, of_process(PEAK) - before]))
    del small, built


def memory(tracer, rings):
    code = sys.orig_argv[sys.orig_argv.index("-c") + 1]
    command = [sys.executable, "-B", "-c", code, "memory", tracer.name, str(rings)]
    return json.loads(subprocess.check_output(command))


def edges(tracer, vertices, triangles, count):
    """Seconds of the calls, and rays that leave the mesh without a hit."""
    rng = np.random.default_rng(2)
    seconds, missed = 0.0, 0
    for first in range(0, count, EDGE_RAYS):
        origins, directions = edge_rays(vertices, triangles, min(EDGE_RAYS, count - first), rng)
        start = time.perf_counter()
        missed += len(origins) - tracer.first(origins, directions)
        seconds += time.perf_counter() - start
    return seconds, missed


def turn_of(works):
    """Seconds of a call, and what it found."""
    start = time.perf_counter()
    found = works()
    taken = time.perf_counter() - start
    if taken > LONG:
        return taken, found
    calls, start = 0, time.perf_counter()
    while True:
        found = works()
        calls += 1
        taken = time.perf_counter() - start
        if taken > TURN:
            return taken / calls, found


def main():
    signal.signal(signal.SIGINT, signal.default_int_handler)
    global FOLDER
    if sys.argv[1:2] == ["memory"]:
        print_memory(sys.argv[2], int(sys.argv[3]))
        return
    order = json.loads(sys.stdin.readline())
    FOLDER = Folder(order["folder"])
    versions, missing, tracers = {}, [], []
    for tracer in TRACERS:
        try:
            module = importlib.import_module(tracer.module)
        except ImportError as error:
            missing.append(f"{tracer.name}: {error}")
            continue
        versions[tracer.module] = str(getattr(module, "__version__", "?"))
        tracers.append(tracer)
    rows = []

    def measured(kind, triangles, count, works):
        seconds = {name: [] for name in works}
        found = {}
        # One more round, which is not counted, brings pages and threads into their state.
        for turn in range(order["rounds"] + 1):
            names = list(works)
            for name in names[turn % len(names) :] + names[: turn % len(names)]:
                time.sleep(PAUSE)
                taken, found[name] = works[name]()
                if turn:
                    seconds[name].append(taken)
        for name, times in seconds.items():
            rows.append(
                {
                    "kind": kind,
                    "triangles": triangles,
                    "rays": count,
                    "tracer": name,
                    "seconds": times,
                    "found": found[name],
                }
            )

    def alone(kind, name, triangles, count, seconds, found=0):
        """A measurement of one package."""
        row = {"kind": kind, "tracer": name, "triangles": triangles, "rays": count, "found": found}
        rows.append(row | {"seconds": seconds})

    for turn in {t.module: t for t in tracers}.values():
        seconds = [import_seconds(turn.module) for _ in range(order["rounds"])]
        alone("import", turn.module, 0, 0, seconds)
    if RtCore in tracers:
        vertices, triangles = mesh(max(order["rings"]))
        scene, (origins, directions) = RtCore(vertices, triangles).scene, rays(4_000_000)
        calls = [lambda: scene.cast(origins, directions), lambda: scene.count(origins, directions)]
        seconds = [stop_seconds(call) for call in calls for _ in range(order["rounds"])]
        alone("stop", RtCore.name, len(triangles), len(origins), seconds)

    vertices, triangles = mesh(100)
    for tracer in tracers:
        if issubclass(tracer, FromRust) or tracer.most is not None:
            continue
        count = order["edge_rays"] if tracer is RtCore else order["edge_rays_of_others"]
        seconds, wrong = edges(tracer(vertices, triangles), vertices, triangles, count)
        alone("edges", tracer.name, len(triangles), count, [seconds], wrong)

    for rings in order["rings"]:
        vertices, triangles = mesh(rings)
        built = {}
        usable = [t for t in tracers if len(triangles) < getattr(t, "most_triangles", 1e99)]
        in_python = [t for t in usable if not issubclass(t, FromRust)]

        def build(tracer):
            start = time.perf_counter()
            built[tracer] = tracer(vertices, triangles)
            return time.perf_counter() - start, len(triangles)

        measured("build", len(triangles), 0, {t.name: (lambda t=t: build(t)) for t in in_python})
        for tracer in in_python:
            held, most = memory(tracer, rings)
            alone("memory", tracer.name, len(triangles), 0, [], held)
            alone("memory while building", tracer.name, len(triangles), 0, [], most)
        for tracer in usable:
            if issubclass(tracer, FromRust):
                built[tracer] = tracer(vertices, triangles)
        for count in order["rays"]:
            origins, directions = rays(count)
            for kind in ("first", "all"):
                works = {}
                for tracer in usable:
                    own = built[tracer]
                    if issubclass(tracer, FromRust):
                        if kind == "first":
                            works[tracer.name] = lambda own=own: own.turn(kind, origins, directions)
                    elif tracer.most is None or count <= tracer.most:
                        call = getattr(own, kind)
                        call = lambda call=call: call(origins, directions)
                        works[tracer.name] = lambda call=call: turn_of(call)
                measured(kind, len(triangles), count, works)
        FOLDER.clear()
    answer = {"versions": versions, "missing": missing, "rows": rows}
    print(json.dumps({"answer": answer}), flush=True)


main()

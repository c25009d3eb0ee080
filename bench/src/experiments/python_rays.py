"""Times ray queries of Python packages in turns; one JSON object in, one out.

In: {"rings": [...], "rays": [...], "rounds": n}. Out: versions, what is missing, and for each mesh,
kind and number of rays the seconds of each package in each round.
"""

import importlib
import json
import os
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


class RtCore:
    name, module, most = "rt_core", "rt_core", None

    def __init__(self, vertices, triangles):
        import rt_core

        self.scene = rt_core.Scene(vertices, triangles)

    def first(self, origins, directions):
        return int(self.scene.cast(origins, directions).hit.sum())

    def all(self, origins, directions):
        return len(self.scene.all_hits(origins, directions).t)


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


def main():
    signal.signal(signal.SIGINT, signal.default_int_handler)
    order = json.load(sys.stdin)
    versions, missing, tracers = {}, [], []
    for tracer in (RtCore, TrimeshRtCore, TrimeshEmbree, Open3D, PyVista):
        try:
            module = importlib.import_module(tracer.module)
        except ImportError as error:
            missing.append(f"{tracer.name}: {error}")
            continue
        versions[tracer.module] = getattr(module, "__version__", "?")
        tracers.append(tracer)
    rows = []

    def measured(kind, triangles, count, works):
        seconds = {name: [] for name in works}
        found = {}
        # One more round, which is not counted, brings pages and caches into their state.
        for turn in range(order["rounds"] + 1):
            names = list(works)
            for name in names[turn % len(names) :] + names[: turn % len(names)]:
                start = time.perf_counter()
                found[name] = works[name]()
                if turn:
                    seconds[name].append(time.perf_counter() - start)
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

    def alone(kind, name, triangles, count, seconds):
        """A measurement without found hits."""
        row = {"kind": kind, "tracer": name, "triangles": triangles, "rays": count, "found": 0}
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

    for rings in order["rings"]:
        vertices, triangles = mesh(rings)
        built = {}

        def build(tracer):
            built[tracer] = tracer(vertices, triangles)
            return len(triangles)

        measured("build", len(triangles), 0, {t.name: (lambda t=t: build(t)) for t in tracers})
        for count in order["rays"]:
            origins, directions = rays(count)
            for kind in ("first", "all"):
                works = {}
                for tracer in tracers:
                    if tracer.most is None or count <= tracer.most:
                        call = getattr(built[tracer], kind)
                        works[tracer.name] = lambda call=call: call(origins, directions)
                measured(kind, len(triangles), count, works)
    json.dump({"versions": versions, "missing": missing, "rows": rows}, sys.stdout)


main()

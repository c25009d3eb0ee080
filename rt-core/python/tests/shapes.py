"""Meshes for the tests."""

import numpy as np


def sphere(rings=32, radius=1.0, dtype=np.float32):
    """A closed sphere, its normals outwards."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    body = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    vertices = np.concatenate([[[0, 0, 1]], body.reshape(-1, 3), [[0, 0, -1]]]) * radius
    n, rows = len(phi), len(theta)
    ring = np.arange(n)
    after = (ring + 1) % n
    faces = [np.stack([np.zeros_like(ring), 1 + ring, 1 + after], axis=-1)]
    for r in range(rows - 1):
        a, b = 1 + r * n, 1 + (r + 1) * n
        faces.append(np.stack([a + ring, b + ring, b + after], axis=-1))
        faces.append(np.stack([a + ring, b + after, a + after], axis=-1))
    last, a = len(vertices) - 1, 1 + (rows - 1) * n
    faces.append(np.stack([a + ring, np.full_like(ring, last), a + after], axis=-1))
    return vertices.astype(dtype), np.concatenate(faces).astype(np.uint32)


def rays(count, seed=1, dtype=np.float32):
    """Rays from a sphere of radius 3 into the middle."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3))
    origins *= 3 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-1.2, 1.2, size=(count, 3)) - origins
    return origins.astype(dtype), directions.astype(dtype)


def slivers(count):
    """Thin triangles along one diagonal of a square, one above the other: each one's box is the
    whole square."""
    z = np.repeat(np.linspace(0, 1, count, dtype=np.float32), 3)
    corner = np.float32([[0, 0], [1, 1], [1, 1 - 1e-4]])
    vertices = np.column_stack([np.tile(corner, (count, 1)), z])
    return np.ascontiguousarray(vertices), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)

"""Points of view."""

from dataclasses import dataclass

import numpy as np

from rt_core import _arrays


@dataclass(frozen=True)
class Camera:
    """A point of view.

    Parameters
    ----------
    eye, target, up : three floats
    fov : float
        Full vertical angle in degrees.
    height : float, optional
        For a parallel projection: the height of the image in units of the world, instead of `fov`.
    near, far : float, optional
        Distances whose depths are 0 and 1; found from the eye and the target by default.
    """

    eye: tuple
    target: tuple
    up: tuple = (0.0, 0.0, 1.0)
    fov: float = 30.0
    height: float | None = None
    near: float | None = None
    far: float | None = None

    def _numbers(self):
        eye, target = _arrays.vector("eye", self.eye), _arrays.vector("target", self.target)
        view = (eye, target, _arrays.vector("up", self.up))
        distance = float(np.linalg.norm(np.subtract(target, eye)))
        if distance == 0:
            raise ValueError(f"eye and target are both {list(eye)}; give different places")
        near = _arrays.positive("near", distance / 1000 if self.near is None else self.near)
        far = self.far
        if far is None:
            far = max(distance * 1000, near * 1000)
        far = _arrays.scalar("far", far, f"more than near, {near}", lambda v: v > near)
        if self.height is not None:
            return view, (_arrays.positive("height", self.height), True, (near, far))
        fov = _arrays.scalar("fov", self.fov, "degrees between 0 and 180", lambda v: 0 < v < 180)
        return view, (float(np.radians(fov)), False, (near, far))


def seen_from_outside(bounds, size):
    """A camera that sees everything, from above and the side."""
    if bounds is None:
        return Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    low, high = np.array(bounds)
    radius = max(float(np.linalg.norm(high - low)) / 2, 1e-30)
    target = (low + high) / 2
    half = np.arctan(np.tan(np.radians(15)) * min(1, size[0] / size[1]))
    distance = radius / np.sin(half)
    eye = target + distance * np.array([0.48, -0.72, 0.5]) / np.linalg.norm([0.48, -0.72, 0.5])
    near = max(distance - radius, distance / 1000) * 0.99
    return Camera(tuple(eye), tuple(target), near=near, far=(distance + radius) * 1.01)

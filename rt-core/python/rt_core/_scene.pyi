from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Quality = Literal["fast", "balanced", "best"]
_Robustness = Literal["watertight", "fast"]
_Storage = Literal["plain", "compact"]

class Hits(NamedTuple):
    t: NDArray[np.floating[Any]]
    primitive: NDArray[np.uint32]
    uv: NDArray[np.float32]
    normal: NDArray[np.float32]
    @property
    def hit(self) -> NDArray[np.bool_]: ...

class AllHits(NamedTuple):
    starts: NDArray[np.int64]
    t: NDArray[np.floating[Any]]
    primitive: NDArray[np.uint32]
    uv: NDArray[np.float32]
    @property
    def ray(self) -> NDArray[np.int64]: ...

class ClosestPoints(NamedTuple):
    point: NDArray[np.float64]
    distance: NDArray[np.float32]
    primitive: NDArray[np.uint32]
    uv: NDArray[np.float32]

class Scene:
    copied: tuple[str, ...]
    def __init__(
        self,
        vertices: ArrayLike,
        triangles: ArrayLike,
        *,
        quality: _Quality = "balanced",
        robustness: _Robustness = "watertight",
        storage: _Storage = "plain",
        threads: int | None = None,
    ) -> None: ...
    @classmethod
    def from_meshes(
        cls,
        meshes: Sequence[tuple[ArrayLike, ArrayLike]],
        *,
        quality: _Quality = "balanced",
        robustness: _Robustness = "watertight",
        storage: _Storage = "plain",
        threads: int | None = None,
    ) -> Scene: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    @property
    def num_triangles(self) -> int: ...
    @property
    def num_meshes(self) -> int: ...
    @property
    def bounds(self) -> NDArray[np.float64] | None: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def build_seconds(self) -> float: ...
    def split(self, primitive: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]: ...
    def cast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: float = 0.0,
        t_max: ArrayLike | None = None,
        normals: bool = True,
        out: Hits | None = None,
        threads: int | None = None,
    ) -> Hits: ...
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: float = 0.0,
        t_max: ArrayLike | None = None,
        out: NDArray[np.bool_] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.bool_]: ...
    def count(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: float = 0.0,
        t_max: ArrayLike | None = None,
        out: NDArray[np.uint32] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.uint32]: ...
    def all_hits(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: float = 0.0,
        t_max: ArrayLike | None = None,
        max_hits: int = 100_000_000,
        threads: int | None = None,
    ) -> AllHits: ...
    def contains(self, points: ArrayLike, *, threads: int | None = None) -> NDArray[np.bool_]: ...
    def closest_point(
        self, points: ArrayLike, *, max_distance: float = ..., threads: int | None = None
    ) -> ClosestPoints: ...
    def signed_distance(
        self, points: ArrayLike, *, threads: int | None = None
    ) -> NDArray[np.float32]: ...

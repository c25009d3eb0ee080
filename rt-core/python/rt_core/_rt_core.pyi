import numpy as np
from numpy.typing import NDArray

NO_HIT: int

def count_threads() -> int: ...
def count_stopped_calls() -> int: ...
def exr_bytes(
    size: tuple[int, int],
    channels: list[tuple[str, str, NDArray[np.float32] | NDArray[np.uint32]]],
    software: str,
) -> bytes: ...

class World:
    triangles: int
    bytes: int
    firsts: list[int]
    bounds: tuple[list[float], list[float]] | None
    build_seconds: float
    def __init__(
        self,
        meshes: list[
            tuple[NDArray[np.float32], NDArray[np.uint32], tuple[float, float, float]]
        ],
        quality: str,
        robustness: str,
        storage: str,
        threads: int,
    ) -> None: ...

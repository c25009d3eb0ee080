"""Checks arguments and makes arrays of them that the native module takes."""

import numpy as np

FLOATS = (np.dtype(np.float32), np.dtype(np.float64))


def unmasked(name, values):
    """``values`` without a mask that hides nothing; one that hides something is refused."""
    if not np.ma.isMaskedArray(values):
        return values
    if np.ma.is_masked(values):
        raise ValueError(
            f"{name} is masked, {int(np.ma.count_masked(values))} of {values.size} numbers; take "
            f"them out, or give {name}.filled(...)"
        )
    return values.data


def numbers(name, values):
    """``values`` as an array of real numbers, copied only if it is none yet."""
    values = unmasked(name, values)
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} is no array: {error}; give rows of equal length") from None
    if array.dtype.kind in "US" and array.ndim == 0:
        raise TypeError(f"{name} is {values!r}; give numbers")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} has dtype {array.dtype}; give float32 or float64")
    return array


def rows_of_three(name, values):
    """``values`` as an (N, 3) array of numbers."""
    array = numbers(name, values)
    if array.ndim != 2 or array.shape[1] != 3:
        if array.size == 0 and array.ndim <= 2:
            return array.reshape(0, 3)
        cure = ""
        if array.shape == (3,):
            cure = f", a single row as [{name}]"
        elif array.ndim == 2 and array.shape[0] == 3:
            cure = f", perhaps {name}.T"
        raise ValueError(f"{name} has shape {array.shape}; give (N, 3){cure}")
    return array


def contiguous(array, dtype):
    """``array`` in C order with ``dtype``, aligned; copied only if it differs."""
    return np.require(array, dtype=dtype, requirements=("C", "A"))


def float_type(*arrays):
    """float32 if all arrays are, float64 otherwise."""
    return FLOATS[0] if all(a.dtype == FLOATS[0] for a in arrays) else FLOATS[1]


def first_bad_row(array):
    """The first row with a number that is not finite, or None."""
    if array.size == 0 or np.isfinite(array.sum(dtype=np.float64)):
        return None
    bad = ~np.isfinite(array).all(axis=1)
    return int(bad.argmax()) if bad.any() else None


def vertices(values):
    """float32 positions, their origin in float64, and what was copied and why."""
    given = rows_of_three("vertices", values)
    row = first_bad_row(given)
    if row is not None:
        raise ValueError(
            f"vertices[{row}] is {given[row].tolist()}; give finite numbers, or take the vertex "
            "and its triangles out"
        )
    if given.dtype == np.float32:
        array = contiguous(given, np.float32)
        copied = [] if array is given or np.shares_memory(array, given) else [
            "vertices: to C order"
        ]
        return array, (0.0, 0.0, 0.0), copied
    array = given.astype(np.float64, copy=False)
    origin = np.zeros(3)
    if len(array):
        low, high = array.min(axis=0), array.max(axis=0)
        if max(np.abs(low).max(), np.abs(high).max()) > 1e37:
            raise ValueError(
                "vertices has coordinates above 1e37, which float32 cannot hold; use another unit"
            )
        centre = 0.5 * low + 0.5 * high
        # Positions far from zero are held relative to a point near them.
        if np.abs(centre).max() > (high - low).max():
            origin = centre.astype(np.float32).astype(np.float64)
    positions = (array - origin).astype(np.float32, order="C")
    reason = f"vertices: {given.dtype} to float32"
    if origin.any():
        reason += f" relative to {origin.tolist()}"
    return positions, tuple(origin.tolist()), [reason]


def triangles(values, vertex_count):
    """uint32 indices in C order, and what was copied and why."""
    values = unmasked("triangles", values)
    try:
        given = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"triangles is no array: {error}; give rows of three") from None
    if given.size == 0 and given.ndim <= 2:
        return np.zeros((0, 3), dtype=np.uint32), []
    if given.dtype.kind not in "iu":
        raise TypeError(f"triangles has dtype {given.dtype}; give an integer type")
    if given.ndim != 2 or given.shape[1] != 3:
        raise ValueError(f"triangles has shape {given.shape}; give (M, 3), vertex indices")
    for value in (given.min(), given.max()):
        if value < 0 or value >= vertex_count:
            row = int(np.argwhere(given == value)[0, 0])
            cure = f"give 0 to {vertex_count - 1}" if vertex_count else "give vertices"
            raise IndexError(
                f"triangles[{row}] has the index {value}, and there are {vertex_count} vertices; "
                f"{cure}"
            )
    if given.dtype == np.int32:
        same = given.view(np.uint32)
        array = contiguous(same, np.uint32)
        copied = [] if np.shares_memory(array, given) else ["triangles: to C order"]
        return array, copied
    array = contiguous(given, np.uint32)
    if np.shares_memory(array, given):
        return array, []
    if given.dtype == np.uint32:
        return array, ["triangles: to C order"]
    return array, [f"triangles: {given.dtype} to uint32"]


def scalar(name, value, rule, accepts):
    """A number that ``accepts`` takes."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, (bool, np.bool_, str, complex)) or not np.isscalar(value):
        raise TypeError(f"{name} is {value!r}; give a number")
    value = float(value)
    if not accepts(value):
        raise ValueError(f"{name} is {value}; give {rule}")
    return value


def positive(name, value):
    return scalar(name, value, "a positive finite number", lambda v: 0 < v < np.inf)


def vector(name, value):
    """Three finite numbers."""
    array = numbers(name, value)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name} is {value!r}; give three finite numbers")
    return tuple(float(v) for v in array)


def whole(name, value, least, most):
    """A whole number."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} is {value!r}; give a whole number")
    if not least <= value <= most:
        raise ValueError(f"{name} is {value}; give {least} to {most}")
    return int(value)


def threads(value):
    """The number that the native module takes; 0 stands for all."""
    if value is None:
        return 0
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"threads is {value!r}; give a whole number, or None for all")
    if value < 1:
        raise ValueError(f"threads is {value}; give 1 or more, or None for all")
    return int(value)


def output(name, array, shape, dtype):
    """A new array for answers, or the caller's, if it can hold them."""
    if array is None:
        return np.empty(shape, dtype=dtype)
    if not isinstance(array, np.ndarray):
        raise TypeError(f"{name} is of type {type(array).__name__}; give a numpy array")
    if array.dtype != dtype:
        raise TypeError(f"{name} has dtype {array.dtype}; give {np.dtype(dtype)}")
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}; give {shape}")
    if not array.flags.writeable:
        raise ValueError(f"{name} is read-only; give an array that can be written")
    if not (array.flags.c_contiguous and array.flags.aligned):
        raise ValueError(f"{name} is not contiguous; give an array in C order")
    return array

"""The gas: arrays with their meaning, their units and their place."""

import json
import os

import numpy as np

from schlieren import _arrays, _words
from schlieren._meaning import OPTIONS, QUANTITIES, Meaning
from schlieren._schlieren import Flow


def _spacing(spacing, rank):
    if _arrays.is_number(spacing):
        found = [_arrays.number("spacing", spacing, "a positive number")] * rank
    else:
        found = _arrays.several("spacing", spacing, rank)
    if min(found) <= 0:
        raise ValueError(
            f"spacing is {spacing}; give positive numbers, and turn an axis round with numpy.flip"
        )
    return found


class _Lattice:
    """Where the numbers of arrays lie, and the arrays."""

    def __init__(self, spacing, origin, coordinates, nan):
        self.spacing, self.origin, self.coordinates = spacing, origin, coordinates
        self.nan = _arrays.one_of("nan", nan, ("raise", "blank"))
        self.shape = None
        self.arrays = {}

    def add(self, role, values):
        """Adds an array, and gives its name."""
        if isinstance(values, str):
            raise TypeError(
                f"{role} is the text {values!r}; give an array, or use Field.from_vtk, "
                "Field.from_xarray or Field.open, which take names"
            )
        found = _arrays.array(role, values)
        if found.ndim not in (2, 3):
            raise ValueError(f"{role} has shape {found.shape}; give (NX, NY, NZ) or (NX, NY)")
        if min(found.shape) < 2 or max(found.shape) >= 2**31:
            raise ValueError(f"{role} has shape {found.shape}; give two nodes or more each way")
        if self.shape is None:
            self.shape, self.first = found.shape, role
        if found.shape != self.shape:
            raise ValueError(
                f"{role} has shape {found.shape}, and {self.first} has {self.shape}; "
                "give arrays of one shape"
            )
        if self.nan == "raise":
            _arrays.finite(role, found)
        name = role if role.isidentifier() else f"array {len(self.arrays)} ({role})"
        self.arrays[name] = found
        return name

    def dictionary(self):
        """What the native module makes a data set of."""
        if self.shape is None:
            raise ValueError(
                "no array is given, so the gas is the same everywhere; give the array of "
                "density, of temperature with pressure, or of n_minus_1"
            )
        rank = len(self.shape)
        extent = [0] * 6
        for axis, count in enumerate(self.shape):
            extent[2 * axis + 1] = count - 1
        data = {"extent": extent}
        flips = []
        if self.coordinates is not None:
            if self.spacing is not None:
                raise ValueError("spacing and coordinates are both given; leave one out")
            flips = self._along(data, rank)
        else:
            if self.spacing is None:
                raise TypeError("Field() needs spacing, the distance of nodes, or coordinates")
            data["kind"] = "ImageData"
            data["spacing"] = [*_spacing(self.spacing, rank), 1.0][:3]
            origin = (0.0,) * rank if self.origin is None else self.origin
            data["origin"] = [*_arrays.several("origin", origin, rank), 0.0][:3]
            data["direction"] = [1.0, 0, 0, 0, 1, 0, 0, 0, 1]
        data["arrays"] = [
            (name, True, 1, _arrays.flat(np.flip(array, flips) if flips else array))
            for name, array in self.arrays.items()
        ]
        return data

    def _along(self, data, rank):
        """Adds the coordinates, and gives the axes to turn round."""
        if self.origin is not None:
            raise ValueError("origin and coordinates are both given; leave one out")
        try:
            given = list(self.coordinates)
        except TypeError:
            given = []
        if len(given) != rank:
            raise ValueError(
                f"coordinates has {len(given)} arrays; give one for each of {rank} axes"
            )
        given = [_arrays.array(f"coordinates[{a}]", x) for a, x in enumerate(given)]
        for a, x in enumerate(given):
            _arrays.finite(f"coordinates[{a}]", x)
        if all(x.shape == self.shape for x in given):
            points = [_arrays.flat(x).astype(np.float64) for x in given]
            points += [np.zeros(len(points[0]))] * (3 - rank)
            data["kind"] = "StructuredGrid"
            data["points"] = np.ascontiguousarray(np.stack(points, 1)).reshape(-1)
            return []
        flips, along = [], []
        for a, x in enumerate(given):
            if x.shape != (self.shape[a],):
                raise ValueError(
                    f"coordinates[{a}] has shape {x.shape}; give ({self.shape[a]},), or all of "
                    f"shape {self.shape}"
                )
            steps = np.diff(x.astype(np.float64))
            if not ((steps > 0).all() or (steps < 0).all()):
                at = int(np.argmax(steps * np.sign(steps[0] or 1) <= 0))
                raise ValueError(
                    f"coordinates[{a}] goes from {x[at]} to {x[at + 1]} at {at}; give numbers "
                    "that rise, or fall"
                )
            if steps[0] < 0:
                flips.append(a)
                x = x[::-1]
            along.append(np.ascontiguousarray(x, dtype=np.float64))
        along += [np.zeros(1)] * (3 - rank)
        data["kind"], data["coordinates"] = "RectilinearGrid", along
        return flips


class Field:
    """A gas on a lattice, or a mesh.

    One of `density`, `temperature` with `pressure`, `n_minus_1`, `electrons` or `curves` sets the
    index of refraction. Each quantity is an array, or one number for the whole field.

    Parameters
    ----------
    density : array_like of shape (NX, NY, NZ) or (NX, NY)
        In kg/m³, or `density_unit`. ``density[i, j, k]`` lies at ``origin + spacing * (i, j, k)``.
    temperature, pressure : array_like
        In K and Pa, or their units.
    humidity, co2_ppm : array_like
        Relative humidity, 0 to 1; CO2 in ppm. With temperature and pressure.
    n_minus_1 : array_like
        The refractivity itself.
    electrons : array_like
        Free electrons per m³.
    species : dict
        Mass fraction by gas, such as ``{"CH4": fractions}``; the rest is air. A number in place of
        a gas's name is its Gladstone-Dale constant in cm³/g.
    curves : dict
        ``{name: (values, knots)}`` or ``{name: (values, knots, weight)}``: any arrays, mapped to
        n - 1 by rows (value, n - 1) of `knots`. An illustration, not physics.
    curve_rule : str
        How curves combine: ``"sum"`` or ``"largest"``.
    absorption, emission, rotation : array_like
        Of the medium, in 1/m, 1/m and rad/m.
    spacing : float or sequence of floats
        Distance of nodes, in `length_unit`.
    origin : sequence of floats
        Place of the first node.
    coordinates : sequence of array_like
        Instead of `spacing`: numbers along each axis, or of every node.
    density_unit, temperature_unit, pressure_unit, length_unit : str or float
        A name, such as ``"g/cm^3"``, ``"degC"``, ``"hPa"`` or ``"mm"``, or SI units per unit. Where
        densities are relative to a free stream, `density_unit` is that one's density in kg/m³.
    nan : str
        ``"raise"`` refuses numbers that are not finite; ``"blank"`` takes them as places without
        data, with a warning.
    **options
        `span`, `revolve` : the depth of a two-dimensional flow, or whether it is half of an
        axisymmetric one. `smoothing_nodes` : standard deviation of the smoothing of shocks, or
        ``"auto"``, which makes jumps from one node to the next averages over cells.
        `resample_nodes`, `resample_samples`, `reconstruction` : how meshes become a lattice.
        `on_cells` : whether light is traced through the cells of the mesh, without a lattice.
        `outside` : ``"auto"`` (behind walls a body, behind an open border gas), ``"blank"``,
        ``"solid"`` or ``"gas"``; `hidden` : one of the last three. `reference_n_minus_1` : of
        the medium around the field. `model` : ``"auto"``, ``"ciddor"`` or ``"gladstone-dale"``.

    Examples
    --------
    >>> import numpy as np
    >>> import schlieren
    >>> x, y, z = np.mgrid[-1:1:33j, -1:1:33j, -1:1:33j]
    >>> density = 1.2 - 0.4 * np.exp(-8 * (x**2 + y**2 + z**2))
    >>> schlieren.Field(density=density, spacing=3, length_unit="mm")
    <schlieren.Field: density, ImageData of 35937 points, 0.096 x 0.096 x 0.096 m>
    """

    def __init__(
        self,
        *,
        density=None,
        temperature=None,
        pressure=None,
        humidity=None,
        co2_ppm=None,
        n_minus_1=None,
        electrons=None,
        species=None,
        curves=None,
        curve_rule=None,
        absorption=None,
        emission=None,
        rotation=None,
        spacing=None,
        origin=None,
        coordinates=None,
        density_unit=None,
        temperature_unit=None,
        pressure_unit=None,
        length_unit=None,
        nan="raise",
        **options,
    ):
        given = dict(locals())
        for name in ("self", "options", "spacing", "origin", "coordinates", "nan", "__class__"):
            given.pop(name, None)
        _arrays.known("Field", options, OPTIONS)
        lattice = _Lattice(spacing, origin, coordinates, nan)
        meaning = Meaning("Field", given | options, lattice.add)
        if len(lattice.shape or ()) == 2 and not (options.get("span") or options.get("revolve")):
            raise ValueError(
                f"{lattice.first} has shape {lattice.shape}; give span, the depth of the flow in "
                "length_unit, or revolve=True for half of an axisymmetric flow"
            )
        data = lattice.dictionary()
        unit = meaning.flow.get("length_unit_m", 1.0)
        for step in data.get("spacing", ()):
            if not 1e-9 <= step * unit <= 1e9:
                raise ValueError(
                    f"spacing is {step * unit} m; give 1e-9 m to 1e9 m, and check length_unit"
                )
        self._set(data, meaning)

    def _set(self, data, meaning):
        try:
            self._native = Flow(data) if isinstance(data, dict) else data
        except ValueError as error:
            raise _words.raised(error) from None
        self._flow, self._media = meaning.flow, meaning.media

    @classmethod
    def _made(cls, data, meaning):
        field = cls.__new__(cls)
        field._set(data, meaning)
        return field

    @classmethod
    def from_vtk(cls, data, **meaning):
        """The gas in a data set of VTK or PyVista.

        Parameters
        ----------
        data : vtkImageData, vtkRectilinearGrid, vtkStructuredGrid, vtkUnstructuredGrid, or blocks
        **meaning
            As for `Field`, with names of arrays of points or cells in place of arrays:
            ``density="rho"``. Components are named as in ``"U:x"``.

        Returns
        -------
        Field
        """
        from schlieren import _vtk

        used = []

        def name_of(role, value):
            if not isinstance(value, str):
                raise TypeError(f"{role} is {type(value).__name__}; give the name of an array")
            used.append((role, value))
            return value

        said = Meaning("Field.from_vtk", meaning, name_of)
        return cls._made(_vtk.dictionary(data, used), said)

    @classmethod
    def from_xarray(cls, data, *, dims=None, nan="raise", **meaning):
        """The gas in a data set of xarray, with the units in its attributes.

        Parameters
        ----------
        data : xarray.Dataset or xarray.DataArray
            Variables and coordinates need an attribute `units`, or the argument for it
            (``density_unit``, ``length_unit``).
        dims : sequence of str, optional
            Dimensions along x, y and z. Those with these names, or with the attribute `axis`, by
            default.
        nan : str
            As for `Field`.
        **meaning
            As for `Field`, with names of variables in place of arrays: ``density="rho"``.

        Returns
        -------
        Field
        """
        from schlieren import _xarray

        return _xarray.field(cls, data, dims, nan, meaning)

    @classmethod
    def open(cls, path, *, spacing=None, origin=None, **meaning):
        """The gas in a file: VTK, PLOT3D, NRRD, MetaImage and others that the program reads.

        Parameters
        ----------
        path : str or os.PathLike
        spacing : float or sequence of three floats, optional
            Distance of nodes in a file that does not say it: NumPy, raw, NRRD, MetaImage, NetCDF
            without coordinates.
        origin : sequence of three floats, optional
            Place of the first node of such a file.
        **meaning
            As for `Field`, with names of arrays of the file in place of arrays.

        Returns
        -------
        Field
        """

        def name_of(role, value):
            if not isinstance(value, str):
                raise TypeError(f"{role} is {type(value).__name__}; give the name of an array")
            return value

        said = Meaning("Field.open", meaning, name_of)
        said.flow["file"] = os.fspath(path)
        if spacing is not None:
            spacing = _spacing(spacing, 3)
        if origin is not None:
            origin = _arrays.several("origin", origin, 3)
        try:
            flow = Flow.open(os.fspath(path), spacing, origin)
        except ValueError as error:
            raise _words.raised(error) from None
        return cls._made(flow, said)

    def info(self):
        """What the data hold: kind, size, arrays with their ranges.

        Returns
        -------
        dict
        """
        found = json.loads(self._native.contents())
        for key in ("guess", "notes"):
            found.pop(key, None)
        return found

    def write(self, path):
        """Writes the data as a file of VTK, which the program `schlieren` reads.

        Parameters
        ----------
        path : str or os.PathLike
            Ends with ``.vti``, ``.vtr``, ``.vts`` or ``.vtu``, as the data need.
        """
        try:
            self._native.write(os.fspath(path))
        except ValueError as error:
            raise _words.raised(error) from None

    def forget(self):
        """Frees what is kept for further images of this field."""
        self._native.forget()

    def __reduce__(self):
        raise TypeError(
            "a Field does not pickle; make it where it is needed, or write() a file and open() it "
            "there"
        )

    def __repr__(self):
        info = self.info()
        said = [n for n in (*QUANTITIES, "multifield") if n in self._flow]
        size = info["size"] and " x ".join(
            f"{s * self._flow.get('length_unit_m', 1.0):.3g}" for s in info["size"]
        )
        where = f", {size} m" if size else ""
        return (
            f"<schlieren.Field: {' and '.join(said)}, {info['kind']} of {info['points']} points"
            f"{where}>"
        )


def series(paths, **meaning):
    """The times of a flow, one field after the other, each read when it is its turn.

    Parameters
    ----------
    paths : str, os.PathLike or a sequence of them
        A collection (``.pvd``), or a file for each time.
    **meaning
        As for `Field.open`.

    Yields
    ------
    Field
    """
    from schlieren._schlieren import series as steps

    if isinstance(paths, (str, os.PathLike)):
        paths = [paths]
    for _, path in steps([os.fspath(p) for p in paths]):
        yield Field.open(path, **meaning)

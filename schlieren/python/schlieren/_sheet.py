"""Contact sheets: one field by all techniques."""

import json
import os

from schlieren import _arrays, _words
from schlieren._render import _scene

#: Arguments of `sheet` that `render` has too.
ARGUMENTS = (
    "view", "wavelength_nm", "field_of_view_m", "center_m", "tolerance_rad", "march",
    "interpolant", "step_voxels", "solids", "reference_n_minus_1",
)  # fmt: skip


class Sheet:
    """A contact sheet.

    Attributes
    ----------
    panels : dict of ndarray of float32, shape (H, W, 3)
        Linear brightness by name: ``"knife-x"``, ``"bos"``...
    labels : dict of (str, str)
        The technique and the numbers of the bench of each panel.
    options : dict of list of str
        Options of the program that make the panel's picture alone.
    report : dict
        The numbers of the benches, the error of deflections, counts of rays, warnings.
    """

    def __init__(self, output):
        self._output = output
        width, height = output.size
        self.panels, self.labels, self.options = {}, {}, {}
        for name, labels, options, pixels in output.panels():
            self.panels[name] = pixels.reshape((height, width, 3))
            self.labels[name], self.options[name] = tuple(labels), options
        self.report = json.loads(output.report())
        self.report["warnings"] = [_words.here(w) for w in self.report["warnings"]]

    def save(self, path, *, title="", columns=4):
        """Writes a file.

        Parameters
        ----------
        path : str or os.PathLike
            ``.png`` for viewing; ``.exr`` with the panels as layers, deflection, displacement of
            BOS dots, and phase.
        title : str
        columns : int
            Panels in a row of the picture.
        """
        path = os.fspath(path)
        ending = os.path.splitext(path)[1].lower().lstrip(".")
        if ending not in ("png", "exr"):
            raise ValueError(f"path is {path!r}; give a name that ends with .png or .exr")
        columns = _arrays.whole("columns", columns, 1, 12)
        if not isinstance(title, str):
            raise TypeError(f"title is {title!r}; give a text")
        self._output.write(path, ending, title, columns)

    def __repr__(self):
        width, height = self._output.size
        return f"<schlieren.Sheet: {len(self.panels)} panels of {width} x {height}>"


def sheet(field, *, size=(320, 320), threads=None, **options):
    """Renders a field by all techniques, with the light traced once.

    The bench of each panel is chosen so that the panel shows the field.

    Parameters
    ----------
    field : Field
    size : (int, int)
        Width and height of each panel in pixels.
    threads : int, optional
    **options
        `view`, `wavelength_nm` (one), `field_of_view_m`, `center_m`, `tolerance_rad`, `march`,
        `interpolant`, `step_voxels`, `solids` and `reference_n_minus_1`, as for `render`.

    Returns
    -------
    Sheet

    Examples
    --------
    >>> import numpy as np
    >>> import schlieren
    >>> x, y, z = np.mgrid[-1:1:33j, -1:1:33j, -1:1:33j]
    >>> density = 1.2 - 0.05 * np.exp(-8 * (x**2 + y**2 + z**2))
    >>> field = schlieren.Field(density=density, spacing=0.003)
    >>> sheet = schlieren.sheet(field, size=(48, 48), tolerance_rad=1e-5)
    >>> len(sheet.panels), sheet.panels["bos"].shape
    (12, (48, 48, 3))
    """
    _arrays.known("sheet", options, ARGUMENTS)
    wavelength = options.get("wavelength_nm")
    if wavelength is not None and not _arrays.is_number(wavelength):
        raise ValueError(f"wavelength_nm is {wavelength!r}; a sheet is of one wavelength, give it")
    scene = _scene(field, "schlieren", size=size, **options)
    threads = _arrays.threads(threads)
    try:
        output = field._native.sheet(scene, threads)
    except ValueError as error:
        raise _words.raised(error) from None
    made = Sheet(output)
    _words.warn(json.loads(output.report())["warnings"], 2)
    return made

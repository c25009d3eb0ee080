"""Images, their layers and their report."""

import json
import os
import sys
from dataclasses import dataclass

import numpy as np

from schlieren import _arrays, _words

#: Layers with what they are made by, and the label of their axis of colours.
_LAYERS = {
    "brightness": (None, "brightness"),
    "deflection_rad": ("deflection", "deflection in rad"),
    "displacement_m": ("deflection", "displacement in m"),
    "apparent_displacement_m": ("deflection", "displacement of the background in m"),
    "transmission": ("deflection", "transmission"),
    "phase_waves": ("phase", "phase in waves"),
    "photons": ("photons", "photons per pixel"),
    "noise": ("noise", "noise of the brightness"),
    "optical_depth": ("deflection", "optical depth"),
    "emission": ("deflection", "emission"),
    "rotation_rad": ("deflection", "rotation in rad"),
}


@dataclass(frozen=True)
class Report:
    """How an image was made.

    Attributes
    ----------
    technique : str
    tolerance_rad : float
        The largest error of a deflection that was asked for.
    deflection_error_rad : float or None
        The one that was measured, from march and interpolation.
    resolution_error_rad : float or None
        An estimate of that from the field's own lattice.
    mesh_error_rad : float or None
        An estimate of that from the mesh that the field comes from.
    largest_deflection_rad : float or None
        With the layer ``"deflection"``.
    silhouette_error_px : float or None
        With bodies.
    march : str
        Method, interpolant and step.
    outside : dict or None
        What was decided about places outside the mesh: the part that they are (``percent``), the
        part in bodies (``bodies_percent``), what walls were known by (``walls_by``), and the part
        of the border of which nothing tells (``undecided_percent``).
    grid : tuple of int or None
        Nodes of the field; none for light through the cells of a mesh.
    index_formula : str
    reference_n_minus_1 : float
        Of the medium around the field.
    n_minus_1_range, density_range_kg_m3 : tuple of float
    levels : (float, float)
        Lowest and highest brightness.
    effects, counters, photons, left_out : dict
        What was computed, and how much of it.
    margin_px : int
    field_seconds, render_seconds : float
    warnings : tuple of str
    """

    technique: str
    tolerance_rad: float
    deflection_error_rad: float | None
    resolution_error_rad: float | None
    mesh_error_rad: float | None
    largest_deflection_rad: float | None
    silhouette_error_px: float | None
    march: str
    outside: dict | None
    grid: tuple | None
    index_formula: str
    reference_n_minus_1: float
    n_minus_1_range: tuple
    density_range_kg_m3: tuple | None
    levels: tuple
    effects: dict
    counters: dict
    photons: dict
    left_out: dict | None
    margin_px: int
    field_seconds: float
    render_seconds: float
    warnings: tuple

    @classmethod
    def _of(cls, text):
        found = json.loads(text)
        found["warnings"] = [_words.here(w) for w in found["warnings"]]
        return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in found.items()})


class Image:
    """An image of a gas; row 0 of its arrays is the top.

    Attributes
    ----------
    brightness : ndarray of float32, shape (H, W) or (H, W, 3)
        Linear, 1 for white.
    deflection_rad, displacement_m : ndarray of float32, shape (H, W, 2)
        Of rays through the pixels' centres, along right and up.
    apparent_displacement_m : ndarray of float32, shape (H, W, 2)
        For BOS: how far the dot at the pixel seems to move. NaN where it is not seen.
    transmission : ndarray of float32, shape (H, W)
        1 free, 0 blocked.
    phase_waves : ndarray of float32, shape (H, W)
    photons : ndarray of uint32, shape (H, W)
    noise : ndarray of float32, shape (H, W)
    optical_depth, emission, rotation_rad : ndarray of float32, shape (H, W)
        Of the medium, if it has them.
    pixel_m : float
        Side of a pixel in the test section.
    extent_m : tuple of float
        Left, right, bottom and top of the image, from the middle of the field.
    report : Report
    scene : str
        Everything that determines the image, as a scene file of the program.
    swept
        In a `sweep`: the value.

    Layers that were not rendered raise `AttributeError`, which says how to ask for them.
    """

    def __init__(self, output):
        self._output = output
        width, height = output.size
        self._arrays = {}
        for name, values in output.layers():
            count = values.size // (width * height)
            shape = (height, width) if count == 1 else (height, width, count)
            self._arrays[name] = values.reshape(shape)
        self.report = Report._of(output.report())
        self.pixel_m = output.pixel_m
        self.swept = None

    def __reduce__(self):
        raise TypeError("an Image does not pickle; send its arrays, or save() it")

    def __copy__(self):
        copied = Image(self._output)
        copied.swept = self.swept
        return copied

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._arrays:
            return self._arrays[name]
        if name in _LAYERS:
            layer = _LAYERS[name][0]
            cure = f"render it with layers={layer!r}"
            if name in ("optical_depth", "emission", "rotation_rad"):
                cure = "give the field that property of the medium"
            elif name == "apparent_displacement_m":
                cure = "it belongs to technique='bos', with layers='deflection'"
            elif layer in ("photons", "noise"):
                cure += ", and by photons"
            raise AttributeError(f"this image has no {name}; {cure}")
        raise AttributeError(f"Image has no attribute {name!r}{_arrays.meant(name, _LAYERS)}")

    def __dir__(self):
        return [*super().__dir__(), *self._arrays]

    @property
    def layers(self):
        """Names of the layers that were rendered."""
        return tuple(self._arrays)

    @property
    def size(self):
        """Width and height in pixels."""
        return self._output.size

    @property
    def scene(self):
        return self._output.scene()

    @property
    def extent_m(self):
        (x, y), (width, height) = self._output.center_m, self.size
        half = 0.5 * width * self.pixel_m, 0.5 * height * self.pixel_m
        return x - half[0], x + half[0], y - half[1], y + half[1]

    def save(self, path, *, overlay=None):
        """Writes a file.

        Parameters
        ----------
        path : str or os.PathLike
            ``.png`` for viewing; ``.exr`` with all layers, their units and the scene; ``.npy``
            with the deflection in rad.
        overlay : str, optional
            Drawn on a ``.png``, with a scale: ``"arrows"`` or ``"lic"`` (lines along the vectors),
            each alone or with ``":deflection"`` or ``":displacement"``.
        """
        path = os.fspath(path)
        ending = os.path.splitext(path)[1].lower().lstrip(".")
        if ending not in ("png", "exr", "npy"):
            raise ValueError(f"path is {path!r}; give a name that ends with .png, .exr or .npy")
        if ending == "npy" and "deflection_rad" not in self._arrays:
            raise ValueError("an .npy file has the deflection; render it with layers='deflection'")
        if overlay is not None:
            if ending != "png":
                raise ValueError(f"overlay is {overlay!r} and path {path!r}; it is drawn on .png")
            if "deflection_rad" not in self._arrays:
                raise ValueError("an overlay draws vectors; render with layers='deflection'")
            if not isinstance(overlay, str):
                raise TypeError(f"overlay is {overlay!r}; give a name, such as 'arrows'")
        self._output.write(path, ending, overlay)

    def _repr_png_(self):
        """For notebooks."""
        return self._output.png()

    def plot(self, layer="brightness", *, component=None, ax=None, **options):
        """Draws a layer with matplotlib, in millimetres of the test section.

        Parameters
        ----------
        layer : str
        component : str, optional
            Of a layer along right and up: ``"right"``, ``"up"`` or ``"length"``, the default.
        ax : matplotlib.axes.Axes, optional
        **options
            For `Axes.imshow`.

        Returns
        -------
        matplotlib.axes.Axes
        """
        try:
            from matplotlib import pyplot
        except ImportError:
            raise ImportError(
                "Image.plot needs matplotlib; install it (pip install matplotlib), or use "
                "Image.save"
            ) from None
        _arrays.one_of("layer", layer, tuple(_LAYERS))
        values, label = getattr(self, layer), _LAYERS[layer][1]
        of_vectors = values.ndim == 3 and values.shape[2] == 2
        if of_vectors:
            component = "length" if component is None else component
            _arrays.one_of("component", component, ("right", "up", "length"))
            if component == "length":
                values = np.hypot(values[..., 0], values[..., 1])
            else:
                values = values[..., ("right", "up").index(component)]
                label = f"{label}, {component}"
                largest = float(np.nanmax(np.abs(values), initial=0)) or 1.0
                options = {"cmap": "RdBu", "vmin": -largest, "vmax": largest} | options
        elif component is not None:
            raise ValueError(f"component has no effect with {layer!r}; leave it out")
        if layer == "brightness":
            # As `save` writes it.
            clipped = np.clip(values, 0, 1)
            curve = 1.055 * np.power(clipped, 1 / 2.4) - 0.055
            values = np.where(clipped <= 0.0031308, 12.92 * clipped, curve)
            options = {"cmap": "gray", "vmin": 0, "vmax": 1} | options
        if ax is None:
            ax = pyplot.subplots()[1]
        shown = ax.imshow(values, extent=[1e3 * e for e in self.extent_m], **options)
        ax.set_xlabel("mm")
        ax.set_ylabel("mm")
        if layer != "brightness":
            ax.figure.colorbar(shown, ax=ax, label=label)
        return ax

    def show(self):
        """Shows the image: in the notebook, or in a window of matplotlib."""
        if in_notebook():
            from IPython.display import display

            display(self)
            return
        self.plot()
        from matplotlib import pyplot

        pyplot.show()

    def __repr__(self):
        width, height = self.size
        got = self.report.deflection_error_rad
        error = "" if got is None else f", deflections to {got:.1e} rad"
        return f"<schlieren.Image: {self.report.technique}, {width} x {height}{error}>"


def in_notebook():
    """Whether a notebook or a console with pictures runs this."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return shell is not None and "IPKernelApp" in getattr(shell, "config", {})

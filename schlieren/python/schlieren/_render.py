"""Renders images: one, several of one field, or a series of fields."""

import dataclasses
import json
import os
import sys

from schlieren import _arrays, _words
from schlieren._field import Field
from schlieren._image import Image
from schlieren._techniques import CUTOFFS, SAMPLINGS, SOURCES, TECHNIQUES, Photons, Schlieren, part

#: Layers besides the brightness, and what they are of.
LAYERS = ("deflection", "phase", "photons", "noise")


def _view(view):
    if isinstance(view, str):
        return _arrays.one_of("view", view, ("x", "y", "z"))
    azimuth, elevation = _arrays.several("view", view, 2)
    return f"{azimuth!r},{elevation!r}"


def _wavelengths(wavelength_nm):
    if _arrays.is_number(wavelength_nm):
        return [_arrays.positive("wavelength_nm", wavelength_nm)]
    given = _arrays.items("wavelength_nm", wavelength_nm, "give a number, or several, such as 633")
    found = [_arrays.positive(f"wavelength_nm[{i}]", w) for i, w in enumerate(given)]
    if not found:
        raise ValueError("wavelength_nm is empty; give one or more, such as 633")
    return found


def _layers(layers):
    cure = f"give some of {', '.join(map(repr, LAYERS))}, or () for none"
    names = [layers] if isinstance(layers, str) else _arrays.items("layers", layers, cure)
    for name in names:
        _arrays.one_of("layers", name, (*LAYERS, "all"))
    chosen = set(LAYERS if "all" in names else names)
    return ("deflection" in chosen or "phase" in chosen, *(n in chosen for n in LAYERS[1:]))


def _technique(technique, cutoff):
    made = part("technique", technique, TECHNIQUES)
    if cutoff is None:
        return made
    if not isinstance(made, Schlieren):
        raise ValueError(f"cutoff has no effect with {made._kind!r}; leave it out")
    if not isinstance(technique, str):
        raise ValueError("cutoff is given, and by technique; leave one out")
    return Schlieren(part("cutoff", cutoff, CUTOFFS))


def _sampling(sampling, samples, seed):
    given = {"samples": samples, "seed": seed}
    given = {name: value for name, value in given.items() if value is not None}
    if sampling is None:
        return Photons(**given) if given else None
    if given:
        raise ValueError(f"{' and '.join(given)} and sampling are given; leave one out")
    return part("sampling", sampling, SAMPLINGS)


def _given(**values):
    """Those that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def _scene(
    field,
    technique="schlieren",
    *,
    cutoff=None,
    view="z",
    wavelength_nm=633.0,
    weights=None,
    source=None,
    beams="auto",
    collimator_m=None,
    schlieren_lens_m=None,
    size=(512, 512),
    field_of_view_m=None,
    center_m=(0.0, 0.0),
    focus_m=None,
    exposure=None,
    samples=None,
    seed=None,
    sampling=None,
    tolerance_rad=1e-7,
    march=None,
    interpolant=None,
    step_voxels=None,
    skip_rad=0.0,
    solids=(),
    analyser_deg=None,
    stop_m=None,
    reference_n_minus_1=None,
):
    """A scene as the JSON that the native module takes."""
    if not isinstance(field, Field):
        raise TypeError(
            f"field is of type {type(field).__name__}; give schlieren.Field(density=..., "
            "spacing=...)"
        )
    number, positive = _arrays.number, _arrays.positive
    lengths = {
        name: None if value is None else positive(name, value)
        for name, value in [
            ("collimator_m", collimator_m),
            ("schlieren_lens_m", schlieren_lens_m),
            ("field_of_view_m", field_of_view_m),
            ("exposure", exposure),
            ("step_voxels", step_voxels),
            ("stop_m", stop_m),
        ]
    }
    angles = {
        name: None if value is None else number(name, value)
        for name, value in [("focus_m", focus_m), ("analyser_deg", analyser_deg)]
    }
    if isinstance(solids, (str, os.PathLike)):
        solids = [solids]
    width, height = (
        _arrays.whole(f"size[{i}]", s, 1, 16384) for i, s in enumerate(_pair("size", size))
    )
    flow = dict(field._flow)
    if reference_n_minus_1 is not None:
        flow["reference_n_minus_1"] = number("reference_n_minus_1", reference_n_minus_1)
    light = {"wavelengths_nm": _wavelengths(wavelength_nm)}
    light["beams"] = _arrays.one_of("beams", beams, ("auto", "axial", "tilted"))
    if weights is not None:
        light["weights"] = _arrays.several("weights", weights, len(light["wavelengths_nm"]))
    if source is not None:
        light["source"] = part("source", source, SOURCES)._spec()
    scene = {
        "flow": flow,
        "view": {"direction": _view(view)},
        "light": light,
        "lenses": _given(
            collimator_m=lengths["collimator_m"], schlieren_m=lengths["schlieren_lens_m"]
        ),
        "technique": _technique(technique, cutoff)._spec(),
        "film": _given(
            size=[width, height],
            field_of_view_m=lengths["field_of_view_m"],
            center_m=_arrays.several("center_m", center_m, 2),
            focus_m=angles["focus_m"],
            exposure=lengths["exposure"],
        ),
        "march": _given(
            tolerance_rad=number("tolerance_rad", tolerance_rad, "0 or more", lambda v: v >= 0),
            method=march,
            interpolant=interpolant,
            step_voxels=lengths["step_voxels"],
            skip_rad=number("skip_rad", skip_rad, "0 or more", lambda v: v >= 0),
        ),
        "solids": {"files": [os.fspath(path) for path in solids]},
        "media": field._media
        | _given(analyser_deg=angles["analyser_deg"], stop_m=lengths["stop_m"]),
    }
    for name, value in (("march", march), ("interpolant", interpolant)):
        if value is not None and not isinstance(value, str):
            raise TypeError(f"{name} is {value!r}; give a name")
    chosen = _sampling(sampling, samples, seed)
    if chosen is not None:
        scene["sampling"] = chosen._spec()
    return json.dumps(scene, allow_nan=False)


def _pair(name, value):
    try:
        pair = tuple(value)
    except TypeError:
        pair = ()
    if len(pair) != 2:
        raise ValueError(f"{name} is {value!r}; give two numbers")
    return pair


#: Arguments of `render` besides the field and the technique.
ARGUMENTS = frozenset(_scene.__kwdefaults__ or ()) | {"technique", "layers", "threads"}


def render(field, technique="schlieren", *, layers=("deflection",), threads=None, **options):
    """Renders the image that an optical bench records of a gas.

    Parameters
    ----------
    field : Field
    technique : str or technique
        ``"schlieren"``, ``"shadowgraph"``, ``"interferogram"``, ``"bos"``, and for comparison
        ``"volume"`` and ``"slice"``; or `Schlieren`, `Shadowgraph`, `Interferogram`, `BOS`,
        `Volume` or `Slice` with values of their own.
    layers : str or sequence of str
        What is rendered besides the image: ``"deflection"`` (with displacement, transmission and
        the largest deflection), ``"phase"``, ``"photons"``, ``"noise"``, or ``"all"``. With
        ``()`` the image alone.
    threads : int, optional
        All of the machine by default. The image does not depend on it.
    cutoff : str or cut-off, optional
        With ``technique="schlieren"``: ``"knife"``, ``"circle"``, ``"complemented-circle"``,
        ``"color"``, or `Knife`, `Circle`, `ComplementedCircle`, `ColorWheel`, `FilterImage` or
        `Painting`.
    view : str or (float, float)
        The light goes along ``"x"``, ``"y"`` or ``"z"``, or by azimuth and elevation in degrees.
    wavelength_nm : float or sequence of floats
        Vacuum wavelengths; several are added up in their colours, with `weights`.
    source : str or source, optional
        ``"point"``, ``"slit"``, ``"circle"``, or `PointSource`, `SlitSource`, `CircleSource`.
    beams : str
        ``"auto"``, ``"axial"`` or ``"tilted"``.
    collimator_m, schlieren_lens_m : float, optional
        Focal lengths.
    size : (int, int)
        Width and height in pixels.
    field_of_view_m : float, optional
        Width of the image in the test section; the whole field by default.
    center_m : (float, float)
        Middle of the image, from that of the field.
    focus_m : float, optional
        The plane in focus, from the middle of the field along the light: for a shadowgraph the
        film, for BOS the background (towards the light).
    exposure : float, optional
        Factor on the brightness.
    samples, seed : int, optional
        Of the photons. For all that `Photons` and `Beams` have, use `sampling`.
    sampling : Photons or Beams, optional
    tolerance_rad : float
        Largest error of a deflection. `Image.report` says what it came to.
    march, interpolant : str, optional
        Chosen from the tolerance by default, as is `step_voxels`.
    skip_rad : float
        Uniform gas is skipped as long as no deflection changes by more.
    solids : sequence of paths
        Bodies in metres, in the field's coordinates (OBJ, STL, PLY, glTF, VTP).
    analyser_deg, stop_m : float, optional
        Behind a medium with `rotation`, and before one with `emission`.
    reference_n_minus_1 : float, optional
        Of the medium around the field; from the field's border by default.

    Returns
    -------
    Image

    Warns
    -----
    SchlierenWarning
        When the tolerance was not met, or something was repaired.

    Examples
    --------
    >>> import numpy as np
    >>> import schlieren
    >>> x, y, z = np.mgrid[-1:1:33j, -1:1:33j, -1:1:33j]
    >>> density = 1.2 - 0.05 * np.exp(-8 * (x**2 + y**2 + z**2))
    >>> field = schlieren.Field(density=density, spacing=0.003)
    >>> image = schlieren.render(field, "schlieren", size=(64, 64), tolerance_rad=1e-5)
    >>> image.brightness.shape, image.deflection_rad.shape
    ((64, 64), (64, 64, 2))
    >>> bool(image.report.deflection_error_rad < image.report.tolerance_rad)
    True
    """
    return _rendered(field, technique, layers, threads, options, level=2)


def _rendered(field, technique, layers, threads, options, level):
    _arrays.known("render", options, ARGUMENTS)
    scene = _scene(field, technique, **options)
    threads = _arrays.threads(threads)
    try:
        output = field._native.render(scene, _layers(layers), threads)
    except ValueError as error:
        raise _words.raised(error) from None
    image = Image(output)
    _words.warn(json.loads(output.report())["warnings"], level + 1)
    return image


def _with(options, path, value):
    """The options with one changed, which may be a part of a part."""
    first, _, rest = path.partition(".")
    if not rest:
        return options | {first: value}
    if first not in options or isinstance(options[first], str):
        classes = {"technique": TECHNIQUES, "cutoff": CUTOFFS, "source": SOURCES}
        if first not in classes:
            raise ValueError(f"argument is {path!r}, and {first} is not given; give it")
        default = {"technique": "schlieren", "cutoff": "knife", "source": "slit"}
        options = options | {first: part(first, options.get(first, default[first]), classes[first])}
    return options | {first: _replaced(options[first], rest, value, path)}


def _replaced(thing, path, value, whole):
    first, _, rest = path.partition(".")
    names = [f.name for f in dataclasses.fields(thing)] if dataclasses.is_dataclass(thing) else []
    if first not in names:
        raise ValueError(
            f"argument is {whole!r}, and {type(thing).__name__} has no {first!r}"
            f"{_arrays.meant(first, names)}"
        )
    if rest:
        value = _replaced(getattr(thing, first), rest, value, whole)
    return dataclasses.replace(thing, **{first: value})


def sweep(field, argument, values, technique="schlieren", **options):
    """Renders one field for several values of an argument.

    What the images have in common is computed once: the field, its spline, its projection.

    Parameters
    ----------
    field : Field
    argument : str
        An argument of `render`, such as ``"focus_m"``, or a part of one, such as
        ``"cutoff.angle_deg"`` or ``"technique.visibility"``.
    values : iterable
    technique, **options
        As for `render`.

    Yields
    ------
    Image
        Its attribute `swept` is the value.

    Examples
    --------
    >>> import numpy as np
    >>> import schlieren
    >>> x, y, z = np.mgrid[-1:1:33j, -1:1:33j, -1:1:33j]
    >>> density = 1.2 - 0.05 * np.exp(-8 * (x**2 + y**2 + z**2))
    >>> field = schlieren.Field(density=density, spacing=0.003)
    >>> images = schlieren.sweep(
    ...     field, "cutoff.angle_deg", [0, 90], size=(32, 32), tolerance_rad=1e-5
    ... )
    >>> [image.swept for image in images]
    [0, 90]
    """
    first = argument.partition(".")[0] if isinstance(argument, str) else argument
    if not isinstance(first, str):
        raise TypeError(f"argument is {argument!r}; give the name of an argument of render")
    if first not in ARGUMENTS:
        raise ValueError(
            f"argument is {argument!r}, which render() does not have"
            f"{_arrays.meant(first, ARGUMENTS)}"
        )
    _arrays.known("sweep", options, ARGUMENTS)
    if not hasattr(values, "__iter__") or isinstance(values, str):
        raise TypeError(f"values is {values!r}; give several, such as [{values!r}]")
    return _swept(field, argument, values, options | {"technique": technique})


def _swept(field, argument, values, options):
    for value in values:
        changed = _with(options, argument, value)
        image = _rendered(
            field,
            changed.pop("technique"),
            changed.pop("layers", ("deflection",)),
            changed.pop("threads", None),
            changed,
            level=2,
        )
        image.swept = value
        yield image


def stream(fields, technique="schlieren", **options):
    """Renders the steps of a series, each when it is asked for.

    All are relative to the medium around the first, so that they can be compared, and bodies are
    read once for each step. A step that was rendered is not kept.

    Parameters
    ----------
    fields : iterable of Field
        Such as `series` of files, or a generator that makes them as a solver goes on.
    technique, **options
        As for `render`.

    Yields
    ------
    Image
    """
    _arrays.known("stream", options, ARGUMENTS)
    if not hasattr(fields, "__iter__"):
        raise TypeError(
            f"fields is of type {type(fields).__name__}; give an iterable of schlieren.Field, such "
            "as schlieren.series(paths, ...)"
        )
    return _streamed(fields, technique, dict(options))


def _streamed(fields, technique, options):
    layers, threads = options.pop("layers", ("deflection",)), options.pop("threads", None)
    for field in fields:
        image = _rendered(field, technique, layers, threads, options, level=2)
        field.forget()
        if options.get("reference_n_minus_1") is None:
            options["reference_n_minus_1"] = image.report.reference_n_minus_1
        yield image


def show(field, technique="schlieren", **options):
    """Renders an image and shows it: in the notebook, or in a window of matplotlib.

    Parameters
    ----------
    field, technique, **options
        As for `render`.

    Returns
    -------
    Image or None
        In a notebook None, so that it does not show the image twice.
    """
    layers, threads = options.pop("layers", ("deflection",)), options.pop("threads", None)
    image = _rendered(field, technique, layers, threads, options, level=2)
    image.show()
    return None if "IPython" in sys.modules and _in_notebook() else image


def _in_notebook():
    from schlieren._image import in_notebook

    return in_notebook()

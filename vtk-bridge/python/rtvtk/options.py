"""Options as keyword arguments: for all renderers, or for those of one plotter."""
import difflib
import os

from . import library as rtv
from .renderer import attach, install, renderers_of, tracer_of, traced_renderers

#: Options with their values, as `vtk-bridge --help` lists them: RTV_SHADOWS is `shadows`.
RULES = {
    "always_trace": "True or False",
    "threads": "1 to 1024",
    "samples": "1 to 65536",
    "progressive": "1 to 65536",
    "shadows": "True or False",
    "light_size": "0 to 45",
    "ao": "0 to 4096",
    "ao_radius": "a positive number, or 'auto'",
    "ao_strength": "0 to 1",
    "reflections": "True or False",
    "mirror": "0 to 1",
    "material": "'scene', 'matte', 'metal', 'glass' or 'transparent'",
    "roughness": "0 to 1",
    "ior": "1 to 4",
    "mode": "'scivis' or 'path'",
    "max_bounces": "0 to 1000",
    "aperture": "0 or a positive number",
    "focus": "a positive number, or 'auto'",
    "robustness": "'watertight' or 'fast'",
    "build": "'fast', 'balanced' or 'best'",
    "point_radius": "0 or a positive number",
    "line_radius": "0 or a positive number",
    "edges": "0 to 4",
    "vtk": "a version, such as '9.1'",
    "seed": "a whole number",
    "report": "a path",
    "quiet": "True or False",
}


def variable(name):
    """The environment variable of an option."""
    return f"RTV_{name.upper()}"


def _text(name, value):
    """A value as the library takes it; empty for the one of the environment, or the default."""
    if value is None:
        return ""
    if RULES[name] == "True or False":
        if value not in (True, False):
            raise TypeError(f"{name} is {value!r}; give True or False")
        return "1" if value else "0"
    if isinstance(value, bool) or not isinstance(value, (str, int, float, os.PathLike)):
        # numpy's numbers too.
        if isinstance(value, bool) or not hasattr(value, "__float__"):
            raise TypeError(f"{name} is {value!r}; give {RULES[name]}")
        value = value.item() if hasattr(value, "item") else float(value)
    text = os.fspath(value) if isinstance(value, (str, os.PathLike)) else repr(value)
    if not text:
        raise ValueError(f"{name} is {value!r}; give {RULES[name]}")
    return text


def checked(options):
    """The texts of options, by the names of their variables.

    Raises `TypeError` for a name that does not exist, and `ValueError` for a value that does not
    fit.
    """
    texts = {}
    # A bridge that draws nothing, so that a call sets all of its options or none.
    bridge = rtv.Bridge()
    for name, value in options.items():
        if name not in RULES:
            near = difflib.get_close_matches(name.lower().replace("rtv_", ""), RULES, n=1)
            meant = f"; did you mean {near[0]!r}?" if near else ""
            raise TypeError(f"enable() got an unexpected keyword argument {name!r}{meant}")
        texts[variable(name)] = text = _text(name, value)
        if not bridge.set_option(variable(name), text):
            raise ValueError(f"{name} is {value!r}; give {RULES[name]}")
    return texts


def enable(plotter=None, **options):
    """Ray traces from the next frame on.

    Parameters
    ----------
    plotter : pyvista.Plotter, vtkRenderWindow or vtkRenderer, optional
        What to trace, and what the options are for; by default all renderers that are made after
        `import rtvtk`, except for what a call for one plotter has set.
    **options
        Those of `vtk-bridge --help` without RTV_, in lower case: `shadows=True`, `ao=16`,
        `samples=4`, `material="metal"`. Options that a call does not name have the value of the
        environment, or their default; so has None.

    Raises
    ------
    TypeError
        For a name that is no option, or a value of the wrong type.
    ValueError
        For a value that does not fit.
    RtvError
        If the library cannot be used.

    Examples
    --------
    >>> import rtvtk
    >>> rtvtk.enable(shadows=True, ao=16, samples=4)
    >>> rtvtk.enable(shadow=True)
    Traceback (most recent call last):
        ...
    TypeError: enable() got an unexpected keyword argument 'shadow'; did you mean 'shadows'?
    >>> rtvtk.disable()
    """
    install()
    texts = checked(options)
    if plotter is None:
        _set_all(dict.fromkeys(map(variable, RULES), "") | texts | {"RTV_OFF": "0"})
        return
    for renderer in _renderers(plotter):
        attach(renderer)
        _set_one(renderer, dict.fromkeys(map(variable, RULES), "") | texts | {"RTV_OFF": "0"})


def disable(plotter=None):
    """Leaves everything to OpenGL from the next frame on.

    Parameters
    ----------
    plotter : pyvista.Plotter, vtkRenderWindow or vtkRenderer, optional
        What to leave; by default all renderers, those of single plotters too.
    """
    install()
    nothing = dict.fromkeys(map(variable, RULES), "")
    if plotter is not None:
        for renderer in _renderers(plotter):
            if tracer_of(renderer) is not None:
                _set_one(renderer, nothing | {"RTV_OFF": "1"})
        return
    _set_all(nothing | {"RTV_OFF": "1"})
    for renderer in traced_renderers():
        _set_one(renderer, nothing | {"RTV_OFF": ""})


def _renderers(plotter):
    found = renderers_of(plotter)
    if not found:
        raise TypeError(
            f"plotter is of type {type(plotter).__name__}; give a pyvista.Plotter that is not "
            "closed, a vtkRenderWindow or a vtkRenderer"
        )
    return found


def _set_all(texts):
    for name, text in texts.items():
        rtv.Bridge.calls()["set_process_option"](name.encode(), text.encode())


def _set_one(renderer, texts):
    bridge = tracer_of(renderer).bridge
    for name, text in texts.items():
        bridge.set_option(name, text)

"""The renderer that replaces vtkRenderer.

Before VTK draws, the props that can be traced are passed to the library and hidden, and rectangles with the traced image are added; afterwards the
original state is restored. OpenGL draws the rest (axes, text, lines, volumes) against the traced image's depth. Picking and selection see the
original props: nothing changes while a selector is active.
"""
import ctypes as C

import vtkmodules.vtkRenderingOpenGL2 as gl
from vtkmodules.vtkCommonCore import vtkVersion, vtkWeakReference

from . import library as rtv
from .choice import Choice
from .eligibility import Untraceable
from .extract import Extractor
from .overlay import Overlay
from .view import add_lights, prepare_lights, size_of, view_of

_VERSION = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion(), vtkVersion.GetVTKBuildVersion())


class _Watched:
    """Data attached to VTK objects, by address: VTK makes a new Python object for a renderer whenever the last one is gone, but only one
    renderer. An event reports its destruction unless all observers were removed (as PyVista does), so each entry is checked: does the object
    exist, and is it still observed?"""

    def __init__(self):
        self._entries = {}

    @staticmethod
    def _address(thing):
        return thing.__this__.split("_")[1]

    def get(self, thing):
        entry = self._entries.get(self._address(thing))
        if entry is None:
            return None
        weak, tag, command, value = entry
        found = thing.GetCommand(tag) if weak.Get() is not None else None
        return value if found is not None and found.__this__ == command.__this__ else None

    def things(self):
        """The objects that exist and are observed."""
        found = [entry[0].Get() for entry in list(self._entries.values())]
        return [thing for thing in found if thing is not None and self.get(thing) is not None]

    def add(self, thing, observe, value):
        for address in [a for a, entry in self._entries.items() if entry[0].Get() is None]:
            del self._entries[address]
        address, weak = self._address(thing), vtkWeakReference()
        weak.Set(thing)
        tag = thing.AddObserver("StartEvent", observe)
        self._entries[address] = weak, tag, thing.GetCommand(tag), value
        # Events of objects under destruction arrive without the object.
        thing.AddObserver("DeleteEvent", lambda *_: self._entries.pop(address, None))


_renderers, _windows = _Watched(), _Watched()


class _Tracer:
    def __init__(self):
        self.bridge = rtv.Bridge()
        self.choice = Choice(self.bridge)
        self.extractor = Extractor(self.bridge)
        self.overlay = Overlay()
        self.hidden, self.shown, self.switched = [], [], []
        # Number of drawn props that OpenGL does not count.
        self.uncounted = 0
        self.failed = False

    def start(self, renderer, _event):
        self.end(renderer, None)
        self.uncounted = 0
        if self.failed:
            return
        try:
            self._trace(renderer)
        except Exception as error:
            # An error here must not break the host program: OpenGL draws everything, as without rtvtk.
            self.end(renderer, None)
            self.failed = True
            self.bridge.warn(f"internal error, OpenGL draws from now on; please report it: {type(error).__name__}: {error}")
            self.bridge.end()

    def _trace(self, renderer):
        if renderer.GetSelector() is not None or renderer.GetUseHiddenLineRemoval() or renderer.GetRenderWindow() is None:
            return
        width, height = size_of(renderer)
        if width < 1 or height < 1 or not self.bridge.begin():
            return
        props = renderer.GetViewProps()
        cheaper = self.choice.opengl_draws(renderer, (width, height))
        if cheaper and not self.bridge.option("RTV_REPORT"):
            self.bridge.end()
            return
        visible = [p for p in (props.GetItemAsObject(i) for i in range(props.GetNumberOfItems())) if p.GetVisibility()]
        if cheaper or not visible:
            for i, prop in enumerate(visible):
                self.bridge.pass_on(f"{prop.GetClassName()} {i}", None)
            self.bridge.end()
            return
        # Render passes read props, depths and normals themselves, except this one, which only draws
        # at a larger size.
        render_pass = renderer.GetPass()
        if render_pass is not None and render_pass.GetClassName() != "vtkSSAAPass":
            reason = f"a render pass draws this renderer ({render_pass.GetClassName()})"
            self.bridge.warn(f"nothing is ray traced: {reason}; take it out, and ask for RTV_SHADOWS or RTV_AO instead")
            for i, prop in enumerate(visible):
                self.bridge.pass_on(f"{prop.GetClassName()} {i}", reason)
            self.bridge.end()
            return
        # Both are created on first use from the visible props, so create them before anything is
        # hidden.
        camera = renderer.GetActiveCamera()
        prepare_lights(renderer)
        self.extractor.begin_frame()
        traced = []
        for i, prop in enumerate(visible):
            name = f"{prop.GetClassName()} {i}"
            try:
                self.extractor.add(renderer, prop, name)
                traced.append(prop)
            except Untraceable as reason:
                self.bridge.pass_on(name, str(reason))
        picture = rtv.Picture()
        drawn = False
        if traced:
            add_lights(self.bridge, renderer)
            if renderer.GetUseSSAO():
                self.bridge.warn("SSAO does not see what is ray traced; use RTV_AO for ambient occlusion")
            view = view_of(renderer, width, height)
            view.one_layer = render_pass is None and all(p.IsA("vtkActor2D") for p in visible if p not in traced)
            drawn = bool(self.bridge.render(C.byref(view), C.byref(picture)))
        self.extractor.end_frame(bool(traced))
        if drawn:
            self.shown = self.overlay.actors(picture, camera)
            self.hidden = traced
            self.uncounted = len(traced) - len(self.shown)
            for prop in traced:
                prop.VisibilityOff()
            for actor in self.shown:
                renderer.AddActor(actor)
            # OpenGL's shadows and occlusion would see the rectangles. The traced image already has its translucent layers in order, so
            # that only those of other props need to be peeled.
            in_order = len(self.shown) > 1 and not any(p.HasTranslucentPolygonalGeometry() for p in visible if p not in traced)
            for name in ("UseShadows", "UseSSAO", *(["UseDepthPeeling"] if in_order else [])):
                if getattr(renderer, f"Get{name}")():
                    self.switched.append(name)
                    getattr(renderer, f"Set{name}")(False)
        self.bridge.end()

    def end(self, renderer, _event):
        for prop in self.hidden:
            prop.VisibilityOn()
        for actor in self.shown:
            renderer.RemoveActor(actor)
        for name in self.switched:
            getattr(renderer, f"Set{name}")(True)
        self.hidden, self.shown, self.switched = [], [], []


def renderers_of(plotter):
    """The renderers of a renderer, a window, or a plotter of PyVista."""
    for name in ("render_window", "ren_win"):
        window = getattr(plotter, name, None)
        if window is not None:
            plotter = window
            break
    if not hasattr(plotter, "IsA"):
        return []
    if plotter.IsA("vtkRenderer"):
        return [plotter]
    if not plotter.IsA("vtkRenderWindow"):
        return []
    renderers = plotter.GetRenderers()
    return [renderers.GetItemAsObject(i) for i in range(renderers.GetNumberOfItems())]


def tracer_of(renderer):
    """What traces a renderer, or None."""
    return _renderers.get(renderer)


def traced_renderers():
    """All renderers that trace."""
    return _renderers.things()


def attach(renderer):
    """Makes a renderer trace, unless it already does."""
    if renderer.IsA("vtkOpenGLRenderer") and _renderers.get(renderer) is None:
        tracer = _Tracer()
        _renderers.add(renderer, tracer.start, tracer)
        renderer.AddObserver("EndEvent", tracer.end)


def _attach_all(window, _event):
    renderers = window.GetRenderers()
    for i in range(renderers.GetNumberOfItems()):
        attach(renderers.GetItemAsObject(i))


def _watch(window):
    if _windows.get(window) is None:
        _windows.add(window, _attach_all, window.GetClassName())


def install():
    """Makes every renderer trace from now on. Raises `RtvError` if the library cannot be loaded."""
    if hasattr(gl, "_rtvtk_renderer"):
        return
    rtv.set_host(*_VERSION)

    @gl.vtkOpenGLRenderer.override
    class RtvRenderer(gl.vtkOpenGLRenderer):
        def __init__(self):
            attach(self)

        def GetNumberOfPropsRendered(self):
            tracer = _renderers.get(self)
            return super().GetNumberOfPropsRendered() + (tracer.uncounted if tracer else 0)

        number_of_props_rendered = property(GetNumberOfPropsRendered)

    gl._rtvtk_renderer = RtvRenderer

    # Renderers of classes derived in Python (PyVista's) are found when their window starts to draw.
    for name in ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow", "vtkXOpenGLRenderWindow", "vtkWin32OpenGLRenderWindow", "vtkCocoaRenderWindow"):
        plain = getattr(gl, name, None)
        if plain is not None:
            plain.override(type(f"Rtv{name[3:]}", (plain,), {"__init__": _watch}))

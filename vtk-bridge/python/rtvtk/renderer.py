"""The renderer that takes vtkRenderer's place.

Before VTK draws, the props that can be traced are given to the library and hidden, and rectangles with the traced picture are put in; afterwards all is
as it was. What is left (axes, text, lines, volumes) is drawn by OpenGL against the traced picture's depth. Picks and selections see the props as ever:
while a selector is at work nothing is touched.
"""
import ctypes as C

import vtkmodules.vtkRenderingOpenGL2 as gl

from . import library as rtv
from .extract import Extractor, Untraceable
from .overlay import Overlay
from .view import add_lights, view_of


class _Tracer:
    def __init__(self):
        self.bridge = rtv.Bridge()
        self.extractor = Extractor()
        self.overlay = None
        self.hidden, self.shown, self.peeling = [], [], None

    def start(self, renderer, _event):
        self.end(renderer, None)
        if renderer.GetSelector() is not None or renderer.GetUseHiddenLineRemoval() or renderer.GetRenderWindow() is None:
            return
        width, height = renderer.GetSize()
        props = renderer.GetViewProps()
        visible = [p for p in (props.GetItemAsObject(i) for i in range(props.GetNumberOfItems())) if p.GetVisibility()]
        if width < 1 or height < 1 or not visible or not self.bridge.begin():
            return
        # Both are made on first use, from what is visible: before anything is hidden.
        renderer.GetActiveCamera()
        traced = []
        for i, prop in enumerate(visible):
            name = f"{prop.GetClassName()} {i}"
            try:
                self.extractor.add(self.bridge, prop, name, renderer)
                traced.append(prop)
            except Untraceable as reason:
                self.bridge.pass_on(name, str(reason))
        picture = rtv.Picture()
        drawn = False
        if traced:
            add_lights(self.bridge, renderer)
            view = view_of(renderer, width, height)
            drawn = bool(self.bridge.render(C.byref(view), C.byref(picture)))
        if drawn:
            self.overlay = self.overlay or Overlay()
            self.shown = self.overlay.actors(picture)
            self.hidden = traced
            for prop in traced:
                prop.VisibilityOff()
            for actor in self.shown:
                renderer.AddActor(actor)
            if len(self.shown) > 1 and renderer.GetUseDepthPeeling():
                # The traced picture has its layers in order already.
                self.peeling = renderer
                renderer.UseDepthPeelingOff()
        self.bridge.end()

    def end(self, renderer, _event):
        for prop in self.hidden:
            prop.VisibilityOn()
        for actor in self.shown:
            renderer.RemoveActor(actor)
        if self.peeling is not None:
            renderer.UseDepthPeelingOn()
        self.hidden, self.shown, self.peeling = [], [], None


def install():
    """From now on every `vtkRenderer()` traces. Raises `RtvError` when the library cannot be loaded."""
    if hasattr(gl, "_rtvtk_renderer"):
        return
    rtv.Bridge()

    @gl.vtkOpenGLRenderer.override
    class RtvRenderer(gl.vtkOpenGLRenderer):
        def __init__(self):
            self._rtv = _Tracer()
            self.AddObserver("StartEvent", self._rtv.start)
            self.AddObserver("EndEvent", self._rtv.end)

    gl._rtvtk_renderer = RtvRenderer

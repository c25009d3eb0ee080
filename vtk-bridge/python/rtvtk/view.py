"""Lights and camera."""
import ctypes as C

from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import library as rtv


def prepare_lights(renderer):
    """Prepares the lights, as the renderer itself does later in the frame."""
    if renderer.GetLights().GetNumberOfItems() == 0 and renderer.GetAutomaticLightCreation():
        renderer.CreateLight()
    renderer.UpdateLightsGeometryToFollowCamera()


def add_lights(bridge, renderer):
    lights = renderer.GetLights()
    for i in range(lights.GetNumberOfItems()):
        light = lights.GetItemAsObject(i)
        if not light.GetSwitch():
            continue
        out = rtv.Light()
        out.position[:], out.focal_point[:] = light.GetTransformedPosition(), light.GetTransformedFocalPoint()
        out.color[:] = [c * light.GetIntensity() for c in light.GetDiffuseColor()]
        out.attenuation[:] = light.GetAttenuationValues()
        out.cone_angle_deg, out.exponent = light.GetConeAngle(), light.GetExponent()
        positional = bool(light.GetPositional())
        spot = positional and light.GetConeAngle() < 90
        out.kind = rtv.LIGHT_SPOT if spot else rtv.LIGHT_POINT if positional else rtv.LIGHT_DIRECTIONAL
        out.headlight = bool(light.LightTypeIsHeadlight()) and not positional
        bridge.light(C.byref(out))


def size_of(renderer):
    """Pixels of the viewport, or of its part in this tile when a large image is made of tiles (VTK's function for it needs C pointers)."""
    window = renderer.GetRenderWindow()
    viewport, tile = renderer.GetViewport(), window.GetTileViewport()

    def pixels(i, whole):
        low, high = max(viewport[i], tile[i]) - tile[i], min(viewport[i + 2], tile[i + 2]) - tile[i]
        return int(high * whole + 0.5) - int(low * whole + 0.5)

    return tuple(pixels(i, whole) for i, whole in enumerate(window.GetSize()))


def _samples(renderer):
    """Samples of a pixel of the framebuffer that this frame is drawn into."""
    # The pass draws into a larger framebuffer of its own.
    if renderer.GetPass() is not None:
        return 0
    return max(0, renderer.GetRenderWindow().GetRenderFramebuffer().GetMultiSamples())


def view_of(renderer, width, height):
    out = rtv.View()
    camera = renderer.GetActiveCamera()
    # The matrices contain everything: window centre, explicit projections, tiles, the eye of a stereo pair. Depth from -1 to 1, as OpenGL has it.
    matrix = vtkMatrix4x4()
    projection = camera.GetProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1.0, 1.0)
    vtkMatrix4x4.Multiply4x4(projection, camera.GetModelViewTransformMatrix(), matrix)
    out.clip_from_world[:] = matrix.GetData()
    matrix.DeepCopy(camera.GetModelViewTransformMatrix())
    matrix.Invert()
    out.has_viewer, out.viewer[:] = 1, [matrix.GetElement(i, 3) for i in range(3)]
    out.background_bottom[:] = renderer.GetBackground()
    out.background_top[:] = renderer.GetBackground2() if renderer.GetGradientBackground() else renderer.GetBackground()
    out.focus_distance = camera.GetDistance()
    out.width, out.height = width, height
    # While the mouse rotates the scene, interactors request several frames a second; for still images far less than one.
    out.interactive = renderer.GetRenderWindow().GetDesiredUpdateRate() > 1.0
    out.shadows = bool(renderer.GetUseShadows())
    out.window_samples = _samples(renderer)
    return out

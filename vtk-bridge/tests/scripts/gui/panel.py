# Run by ParaView's own window (paraview --script): sets options of the view's panel as the panel's
# widgets do, and saves the resulting images.
import os
import sys
import traceback

out = os.environ["PANEL_OUT"]
sys.path.insert(0, os.environ["PANEL_MODULES"])
sys.argv = ["panel.py", out]


def main():
    from paraview.simple import AddLight, Box, GetActiveView, Plane, Render, Show

    from capture import save

    view = GetActiveView()
    Show(Plane(Origin=[-6, -4, 0], Point1=[6, -4, 0], Point2=[-6, 12, 0]), view).DiffuseColor = [0.8, 0.8, 0.8]
    Show(Box(Center=[0, 0, 0.5]), view).DiffuseColor = [0.9, 0.1, 0.1]
    view.UseFXAA = 0
    view.OrientationAxesVisibility = 0
    view.UseLight = 0
    lamp = AddLight(view=view)
    lamp.Coords = "Scene"
    lamp.Position = [-5, -3, 6]
    lamp.FocalPoint = [0, -1, 0]
    view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [0, -6, 4], [0, -0.5, 0.5], [0, 0, 1]
    view.CameraViewAngle = 40

    def picture(name):
        Render(view)
        window = view.GetRenderWindow()
        renderer = view.SMProxy.GetRenderer()

        def pixel(*world):
            renderer.SetWorldPoint(*world, 1)
            renderer.WorldToDisplay()
            return [int(c) for c in renderer.GetDisplayPoint()[:2]]

        save(window, name, shadow=pixel(0.75, 0.2, 0), lit=pixel(-1.5, 0, 0), kind=window.GetClassName())

    picture("plain")
    view.RayTracing.Shadows = 1
    picture("shadows")
    view.RayTracing.Shadows = 0
    picture("back")
    view.RayTracing.EnableRayTracing = 0
    picture("off")


code = 1
try:
    main()
    code = 0
except Exception:
    # The window captures Python's output.
    traceback.print_exc(file=sys.__stderr__)
sys.__stderr__.flush()
# The window would wait for its user.
os._exit(code)

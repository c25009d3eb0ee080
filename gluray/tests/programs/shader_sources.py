"""Writes the sources of all programs that VTK makes for surfaces: shader_sources.py FOLDER.

The scenes are those of wheel_scene.py and some of composite data; `replaced-NAME` are surfaces whose shaders a script has changed.
"""
import os
import runpy
import sys
import vtk
import egl_window
from vtkmodules.util.misc import calldata_type

folder = sys.argv[1]
scenes = os.path.join(os.path.dirname(os.path.abspath(__file__)), "wheel_scene.py")
KINDS = (
    "plain flat cells translucent peeled clipped lights light_kit both_sides physical physical_lights edges moved_back "
    "translucent_moved_back pictures pictures_smaller pictures_over_colors pictures_under_lamps translucent_pictures "
    "physical_pictures images blocks"
).split()

# Changes that scripts make to a lit surface: shader, replaced text, before or after VTK's own
# replacements, new text. VTK renames gl_FragData[0] after that.
LIT = "  gl_FragData[0] = vec4(ambientColor + diffuse + specular, opacity);"
POWER = "  float sf = pow(df, specularPower);"
REPLACED = {
    "back_faces_discarded": [("Fragment", "//VTK::TCoord::Impl", True, "if (gl_FrontFacing == false) { discard; }\n//VTK::TCoord::Impl")],
    "normals_turned": [("Fragment", "//VTK::Light::Impl", True, "normalVCVSOutput = -normalVCVSOutput;\n//VTK::Light::Impl")],
    "normals_turned_under_an_empty_condition": [("Fragment", "//VTK::Light::Impl", True, "if (gl_FrontFacing == false) { } normalVCVSOutput = -normalVCVSOutput;\n//VTK::Light::Impl")],
    "highlights_behind_if_0": [("Fragment", POWER, False, "#if 0\n" + POWER + "\n#else\n  float sf = pow(df, specularPower)*0.0;\n#endif")],
    "light_behind_if_0": [("Fragment", LIT, False, "#if 0\n" + LIT + "\n#else\n  gl_FragData[0] = vec4(ambientColor + diffuseColor, opacity);\n#endif")],
    "light_within_if_false": [("Fragment", LIT, False, "if (false) {" + LIT + "}")],
    "unlit_in_the_end": [("Fragment", LIT, False, LIT + "\n  gl_FragData[0] = vec4(ambientColor + diffuseColor, opacity);")],
    "a_comment_over_light": [("Fragment", LIT, False, "/*" + LIT + "*/\n  gl_FragData[0] = vec4(ambientColor + diffuseColor, opacity);")],
    "a_macro_for_a_function": [("Fragment", "//VTK::Light::Dec", True, "#define pow(a, b) (a)\n//VTK::Light::Dec")],
    "a_macro_for_a_uniform": [("Fragment", "//VTK::Light::Impl", True, "#define lightColor0 vec3(0.0, 1.0, 0.0)\n//VTK::Light::Impl")],
    "a_function_of_its_own": [("Fragment", "//VTK::Light::Dec", True, "//VTK::Light::Dec\nfloat pow(float a, float b) { return a; }")],
    "a_constant_for_a_uniform": [("Fragment", "uniform float opacityUniform;", False, "const float opacityUniform = 0.5;")],
    "flat_colours": [("Fragment", "in vec4 vertexColorVSOutput;", False, "flat in vec4 vertexColorVSOutput;"),
                     ("Vertex", "out vec4 vertexColorVSOutput;", False, "flat out vec4 vertexColorVSOutput;")],
    "a_surface_that_is_moved": [("Vertex", "//VTK::PositionVC::Impl", True, "//VTK::PositionVC::Impl\n gl_Position.x += 0.1*gl_Position.w;")],
    "normals_that_nobody_writes": [("Vertex", "//VTK::Normal::Impl", True, "")],
    "another_colour": [("Fragment", "//VTK::Light::Impl", True, "//VTK::Light::Impl\n gl_FragData[0].rgb = gl_FragData[0].bgr;")],
}


def write(name, texts):
    for ending, text in zip(("vert", "geom", "frag"), texts):
        with open(os.path.join(folder, name + "." + ending), "w") as file:
            file.write(text or "")


def watch(name, mappers):
    """Makes VTK write the sources of the programs that mappers draw with."""
    seen = {}

    @calldata_type(vtk.VTK_OBJECT)
    def updated(mapper, event, program):
        if program is None:
            return
        shaders = program.GetVertexShader(), program.GetGeometryShader(), program.GetFragmentShader()
        texts = tuple(shader.GetSource() or "" for shader in shaders)
        if texts not in seen:
            seen[texts] = len(seen)
            write("%s-%d" % (name, seen[texts]), texts)

    for mapper in mappers:
        mapper.AddObserver("UpdateShaderEvent", updated)


def draw(name, renderer):
    actors = renderer.GetActors()
    watch(name, [actors.GetItemAsObject(i).GetMapper() for i in range(actors.GetNumberOfItems())])
    # An off-screen window of the class that this VTK has; kept alive, because its programs are
    # deleted with it.
    window = egl_window.window(renderer)
    window.SetSize(64, 64)
    renderer.ResetCamera()
    window.Render()


def elevated(x):
    sphere = vtk.vtkSphereSource()
    sphere.SetCenter(x, 0, 0)
    heights = vtk.vtkElevationFilter()
    heights.SetInputConnection(sphere.GetOutputPort())
    heights.Update()
    out = vtk.vtkPolyData()
    out.ShallowCopy(heights.GetOutput())
    return out


def composite(scalars, physical, back):
    """Blocks, one of which has its own colour."""
    blocks = vtk.vtkMultiBlockDataSet()
    for i in range(2):
        data = elevated(i)
        if scalars == "cells":
            values = vtk.vtkFloatArray()
            for cell in range(data.GetNumberOfCells()):
                values.InsertNextValue(cell)
            data.GetCellData().SetScalars(values)
        blocks.SetBlock(i, data)
    # Before VTK 9.3, the class of this name does something else.
    old = vtk.vtkVersion.GetVTKMinorVersion() < 3
    mapper = vtk.vtkCompositePolyDataMapper2() if old else vtk.vtkCompositePolyDataMapper()
    mapper.SetInputDataObject(blocks)
    mapper.SetScalarVisibility(scalars is not None)
    if scalars == "cells":
        mapper.SetScalarModeToUseCellData()
    mapper.SetCompositeDataDisplayAttributes(vtk.vtkCompositeDataDisplayAttributes())
    mapper.SetBlockColor(1, (1, 0, 0))
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    if physical:
        actor.GetProperty().SetInterpolationToPBR()
    if back:
        actor.SetBackfaceProperty(vtk.vtkProperty())
    renderer = vtk.vtkRenderer()
    renderer.AddActor(actor)
    return renderer


def replaced(changes):
    """A sphere with colours of points, whose shaders are changed."""
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(elevated(0))
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    for stage, text, first, new in changes:
        getattr(actor.GetShaderProperty(), "Add%sShaderReplacement" % stage)(text, first, new, False)
    renderer = vtk.vtkRenderer()
    renderer.AddActor(actor)
    return renderer


for kind in KINDS:
    egl_window.show = lambda renderer, *_: draw(kind, renderer)
    sys.argv = [scenes, kind]
    runpy.run_path(scenes)
for scalars in (None, "points", "cells"):
    for physical in (False, True):
        for back in (False, True):
            draw("composite_%s_%d_%d" % (scalars, physical, back), composite(scalars, physical, back))
for name, changes in REPLACED.items():
    draw("replaced-" + name, replaced(changes))
draw("unchanged", replaced([]))
with open(os.path.join(folder, "version"), "w") as file:
    file.write(vtk.vtkVersion.GetVTKVersion())

"""Surfaces as PyVista and the current VTK draw them, one kind of scene per run: wheel_scene.py [KIND [SAMPLES [FRAMES]]]."""
import sys
import vtk
from egl_window import show

kind = sys.argv[1] if len(sys.argv) > 1 else "plain"
samples = int(sys.argv[2]) if len(sys.argv) > 2 else 0
frames = int(sys.argv[3]) if len(sys.argv) > 3 else 1
renderer = vtk.vtkRenderer()


def made(factory, **values):
    """A VTK object with properties set; by methods, as older versions require."""
    out = getattr(vtk, "vtk" + factory)()
    for name, value in values.items():
        set_value = getattr(out, "Set" + name)
        set_value(*value) if isinstance(value, tuple) else set_value(value)
    return out


def place(i):
    return 1.1 * (i % 2), 1.1 * (i // 2), 0


def number_cells(data, mapper, number):
    """Gives cells values computed from their numbers by `number`, and colours by these."""
    values = vtk.vtkFloatArray()
    values.SetName("values")
    for cell in range(data.GetNumberOfCells()):
        values.InsertNextValue(number(cell))
    data.GetCellData().SetScalars(values)
    mapper.SetScalarModeToUseCellData()
    mapper.SetScalarRange(values.GetRange())


def sphere(i, radius=0.5, normals=True, cells=False, points=False, resolution=32):
    """The sphere at place `i` of four as an actor; with colours of cells or points if requested."""
    source = made("SphereSource", ThetaResolution=resolution, PhiResolution=resolution, Radius=radius, Center=place(i))
    heights = made("ElevationFilter", LowPoint=(0, 0, -0.5), HighPoint=(0, 0, 0.5))
    heights.SetInputConnection(source.GetOutputPort())
    heights.Update()
    data = vtk.vtkPolyData()
    data.ShallowCopy(heights.GetOutput())
    if not normals:
        data.GetPointData().SetNormals(None)
    mapper = made("PolyDataMapper", ScalarVisibility=cells or points)
    mapper.SetInputData(data)
    if cells:
        number_cells(data, mapper, lambda cell: cell * 7 % 13)
    actor = made("Actor", Mapper=mapper)
    actor.GetProperty().SetColor(0.9, 0.4, 0.2)
    actor.GetProperty().SetSpecular(0.3)
    actor.GetProperty().SetSpecularPower(20)
    renderer.AddActor(actor)
    return actor


def plain():
    """Without normals, with colour maps that are applied after interpolation, under a headlight."""
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2).GetMapper().InterpolateScalarsBeforeMappingOn()


def flat():
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2).GetProperty().SetInterpolationToFlat()


def cells():
    """Colours of cells, smooth and flat, of triangles and of quads that VTK splits."""
    for i in range(3):
        sphere(i, normals=i % 2 == 0, cells=True)
    plane = made("PlaneSource", XResolution=9, YResolution=7, Origin=(0.6, 0.6, 0), Point1=(1.6, 0.6, 0.3), Point2=(0.6, 1.6, 0.2))
    plane.Update()
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(plane.GetOutput())
    number_cells(plane.GetOutput(), mapper, lambda cell: cell)
    renderer.AddActor(made("Actor", Mapper=mapper))


def translucent():
    """Translucent layers that VTK sums in any order, in front of and behind an opaque surface."""
    sphere(0).GetProperty().SetOpacity(0.4)
    sphere(0, radius=0.3)
    sphere(1, points=True).GetProperty().SetOpacity(0.6)
    sphere(1, radius=0.7, normals=False).GetProperty().SetOpacity(0.3)
    sphere(2, cells=True).GetProperty().SetOpacity(0.5)
    sphere(3, radius=0.8).GetProperty().SetOpacity(0.2)


def peeled():
    translucent()
    renderer.SetUseDepthPeeling(1)
    renderer.SetMaximumNumberOfPeels(50)
    renderer.SetOcclusionRatio(0.0)


def clip(actor, i, *normals):
    for normal in normals:
        x, y, _ = place(i)
        actor.GetMapper().AddClippingPlane(made("Plane", Origin=(x, y, 0.1), Normal=normal))


def clipped():
    """Two planes clip the mapper's triangles; the inside becomes visible."""
    for i in range(4):
        clip(sphere(i, normals=i % 2 == 0, cells=i >= 2), i, (-1, 0.3, -0.2), (0, -1, 0.2))


def lights(material=lambda actor: None):
    """A lamp, a spot, and a distant light."""
    for i in range(4):
        material(sphere(i, normals=i % 2 == 0, points=i >= 2))
    renderer.AutomaticLightCreationOff()
    for cone, color in (90, (1, 1, 1)), (20, (0.5, 0.5, 1)), (None, (0.5, 0.1, 0.1)):
        light = made("Light", Color=color, FocalPoint=(0.5, 0.5, 0), Position=(-1 if cone is None else 1, 1, 2))
        if cone is not None:
            light.SetPositional(1)
            light.SetConeAngle(cone)
            light.SetExponent(2)
            light.SetAttenuationValues(0.5, 0.1, 0.1)
        renderer.AddLight(light)


def light_kit():
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2)
    renderer.AutomaticLightCreationOff()
    vtk.vtkLightKit().AddLightsToRenderer(renderer)


def both_sides():
    """Hemispheres whose insides have their own material."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0)
        clip(actor, i, (-1, 0.3, -0.6))
        actor.SetBackfaceProperty(made("Property", Color=(0.1, 0.8, 0.3), Specular=0.2))
        actor.GetProperty().SetLighting(i != 3)


def metal(actor):
    actor.GetProperty().SetInterpolationToPBR()
    actor.GetProperty().SetMetallic(0.4)
    actor.GetProperty().SetRoughness(0.35)


def physical():
    """Physically based, under a light at the eye."""
    for i in range(4):
        metal(sphere(i, normals=i % 2 == 0, points=i >= 2))


def physical_lights():
    lights(metal)


def edges():
    """Lines along the edges of cells."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0, cells=i == 2, resolution=14)
        actor.GetProperty().SetEdgeVisibility(True)
        actor.GetProperty().SetEdgeColor(0.1, 0.1, 0.6)
        actor.GetProperty().SetLineWidth(1 + i % 2)
        if i == 3:
            clip(actor, i, (-1, 0.3, -0.6))


def moved_back(opacity=1):
    """Surfaces with a polygon offset, by the slope and by a constant, as vedo sets it for every mesh."""
    moves = ((3, 4), (0, 0), (10, 66000), (1, 10))
    for i, (factor, units) in enumerate(moves):
        a = sphere(i, cells=i == 2, resolution=16)
        b = sphere(i, radius=0.5 + 0.0004 * i, normals=i < 2, resolution=16)
        b.GetProperty().SetColor(0.2, 0.6, 0.9)
        for actor, move in ((a, (factor, units)), (b, (0, 0))):
            actor.GetProperty().SetOpacity(opacity)
            actor.GetMapper().SetResolveCoincidentTopologyToPolygonOffset()
            actor.GetMapper().SetRelativeCoincidentTopologyPolygonOffsetParameters(*move)
        b.SetPosition(0.02, 0, 0)
        wires = made("ExtractEdges", InputData=a.GetMapper().GetInput())
        lines = made("PolyDataMapper", InputConnection=wires.GetOutputPort(), ScalarVisibility=False)
        renderer.AddActor(made("Actor", Mapper=lines))


def translucent_moved_back():
    """The same, translucent."""
    moved_back(0.5)


def picture(components=3, alpha=255, **values):
    """A checkerboard texture on gradients."""
    data = vtk.vtkImageData()
    data.SetDimensions(64, 32, 1)
    data.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, components)
    for x in range(64):
        for y in range(32):
            on = (x // 8 + y // 8) % 2
            texel = 4 * x if on else 255, 40 + 6 * y, 180 if on else 60, alpha if on else 255
            for k in range(components):
                data.SetScalarComponentFromDouble(x, y, 0, k, texel[k])
    out = made("Texture", **values)
    out.SetInputData(data)
    return out


def pictured(i, texture, data=None, normals=True, cells=False, points=False):
    """The sphere at place `i`, or other data moved there, with a texture."""
    actor = sphere(i, normals=normals, cells=cells, points=points)
    if data is None:
        data = made("TexturedSphereSource", ThetaResolution=32, PhiResolution=32, Radius=0.5)
    colored = made("ElevationFilter", LowPoint=(0, 0, -0.5), HighPoint=(0, 0, 0.5))
    colored.SetInputConnection(data.GetOutputPort())
    colored.Update()
    surface = vtk.vtkPolyData()
    surface.ShallowCopy(colored.GetOutput())
    if not normals:
        surface.GetPointData().SetNormals(None)
    actor.GetMapper().SetInputData(surface)
    if cells:
        number_cells(surface, actor.GetMapper(), lambda cell: cell * 7 % 13)
    if texture is not None:
        actor.SetTexture(texture)
    actor.SetPosition(*place(i))
    actor.GetProperty().SetColor(0.9, 0.8, 0.7)
    return actor


def floor(repeats):
    """A plane that recedes, with the texture repeated on it."""
    plane = made("PlaneSource", Origin=(-0.5, -0.5, 0.4), Point1=(0.5, -0.5, 0.4), Point2=(-0.5, 0.5, -2))
    scaled = made("TransformTextureCoords", Scale=(repeats, repeats, 1))
    scaled.SetInputConnection(plane.GetOutputPort())
    return scaled


def pictures():
    """Textures on surfaces with and without normals, with and without filters, repeated and not."""
    pictured(0, picture(Interpolate=1))
    pictured(1, picture(Interpolate=0), normals=False).GetProperty().SetInterpolationToFlat()
    pictured(2, picture(Interpolate=1, Repeat=0, EdgeClamp=1), floor(2))
    pictured(3, picture(4, Interpolate=0), floor(3)).GetProperty().LightingOff()


def pictures_smaller():
    """Strongly minified textures, with isotropic and anisotropic mipmaps."""
    for i, most in enumerate((1, 1, 4, 16)):
        texture = picture(Interpolate=1, Mipmap=1)
        texture.SetMaximumAnisotropicFiltering(most)
        pictured(i, texture, floor(9) if i else None)


def pictures_over_colors():
    """Textures over colours of points and cells, and over colour maps, which have other coordinates."""
    pictured(0, picture(Interpolate=1), points=True)
    pictured(1, picture(Interpolate=1), normals=False, cells=True)
    pictured(2, picture(Interpolate=1), points=True).GetMapper().InterpolateScalarsBeforeMappingOn()
    actor = pictured(3, picture(Interpolate=1), points=True)
    turn = vtk.vtkInformation()
    key = getattr(vtk.vtkProp, "GENERAL_TEXTURE_TRANSFORM", None) or vtk.vtkProp.GeneralTextureTransform
    turn.Set(key(), [2, 0.5, 0, 0.1, -0.3, 1.5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], 16)
    actor.SetPropertyKeys(turn)


def pictures_under_lamps():
    """Lit by lamps, one of which does not affect back faces."""
    lights()
    renderer.RemoveAllViewProps()
    for i in range(4):
        actor = pictured(i, picture(Interpolate=1), normals=i % 2 == 0)
        if i > 1:
            clip(actor, i, (-1, 0.3, -0.6))
        if i == 3:
            actor.GetProperty().SetShowTexturesOnBackface(False)


def translucent_pictures():
    """With translucent texels, and with an additional opacity."""
    pictured(0, picture(4, 120, Interpolate=1))
    pictured(1, picture(Interpolate=1)).GetProperty().SetOpacity(0.5)
    pictured(2, picture(4, 30, Interpolate=1), normals=False, points=True)
    sphere(3, radius=0.3)
    pictured(3, picture(4, 60, Interpolate=1)).GetProperty().SetOpacity(0.7)


def physical_pictures():
    """Colours of physically based materials, which are in sRGB."""
    for i in range(4):
        actor = pictured(i, None, points=i == 3)
        metal(actor)
        actor.GetProperty().SetBaseColorTexture(picture(Interpolate=i != 1, UseSRGBColorSpace=1))


def images():
    """Slices of an image through a body, which VTK draws as textures on planes."""
    source = made("RTAnalyticSource", WholeExtent=(-10, 10, -10, 10, -10, 10))
    for i in range(3):
        mapper = made("ImageSliceMapper", Orientation=i, SliceNumber=2 * i)
        mapper.SetInputConnection(source.GetOutputPort())
        image = made("ImageSlice", Mapper=mapper)
        image.GetProperty().SetColorWindow(200)
        image.GetProperty().SetColorLevel(160)
        image.GetProperty().SetInterpolationType(i % 2)
        renderer.AddViewProp(image)
    sphere(0, radius=6)
    renderer.GetActiveCamera().SetPosition(30, 20, 40)


def blocks():
    """Blocks with colours of their own that override others: of points and cells, of back faces, of physically based materials."""
    for i in range(4):
        data = vtk.vtkMultiBlockDataSet()
        for k in range(2):
            one = sphere(i, radius=0.5 - 0.2 * k, cells=i == 1, points=i != 1)
            renderer.RemoveActor(one)
            data.SetBlock(k, one.GetMapper().GetInput())
        # Before VTK 9.3, the class of the other name does something else.
        old = vtk.vtkVersion.GetVTKMinorVersion() < 3
        mapper = made("CompositePolyDataMapper2" if old else "CompositePolyDataMapper", InputDataObject=data)
        if i == 1:
            mapper.SetScalarModeToUseCellData()
        mapper.SetCompositeDataDisplayAttributes(vtk.vtkCompositeDataDisplayAttributes())
        mapper.SetBlockColor(1, (0.2, 0.5, 0.9))
        actor = made("Actor", Mapper=mapper)
        if i == 2:
            actor.SetBackfaceProperty(made("Property", Color=(0.9, 0.8, 0.1), Specular=0.2))
            mapper.ScalarVisibilityOff()
        if i == 3:
            metal(actor)
        clip(actor, i, (-1, 0.3, -0.6))
        renderer.AddActor(actor)


def replaced():
    """A script's own shader: VTK's statements at other places discard back faces. One surface is unchanged."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0)
        clip(actor, i, (-1, 0.3, -0.6))
        if i:
            hole = "if (gl_FrontFacing == false) { discard; }\n//VTK::TCoord::Impl"
            actor.GetShaderProperty().AddFragmentShaderReplacement("//VTK::TCoord::Impl", True, hole, False)


def shadows():
    """Lit by lamps, whose shadows VTK adds by drawing everything again."""
    lights()
    both = vtk.vtkRenderPassCollection()
    pass_of_shadows = vtk.vtkShadowMapPass()
    both.AddItem(vtk.vtkRenderStepsPass())
    both.AddItem(pass_of_shadows.GetShadowMapBakerPass())
    both.AddItem(pass_of_shadows)
    sequence = vtk.vtkSequencePass()
    sequence.SetPasses(both)
    camera = vtk.vtkCameraPass()
    camera.SetDelegatePass(sequence)
    renderer.SetPass(camera)


def glyph_points(count=6):
    """A grid of points with directions, sizes and values."""
    points = vtk.vtkPoints()
    arrays = [made("FloatArray", Name=name, NumberOfComponents=n) for name, n in (("direction", 3), ("size", 1), ("value", 1))]
    for k in range(count ** 3):
        x, y, z = k % count, k // count % count, k // count ** 2
        points.InsertNextPoint(x / count - 0.4, y / count - 0.4, z / count - 0.4)
        arrays[0].InsertNextTuple3(1 + x, y - 2, z - x)
        arrays[1].InsertNextTuple1(0.4 + (k * 7 % 11) / 11)
        arrays[2].InsertNextTuple1(k * 5 % 17)
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    for array in arrays:
        data.GetPointData().AddArray(array)
    data.GetPointData().SetActiveScalars("value")
    return data


def glyph(i, source, size=0.13, count=6):
    """Copies of `source` at the points of place `i`, turned, scaled and coloured by them."""
    mapper = made("Glyph3DMapper", InputData=glyph_points(count), OrientationArray="direction", ScaleArray="size", ScaleFactor=size)
    mapper.SetScaleModeToScaleByMagnitude()
    mapper.SetScalarRange(0, 16)
    mapper.SetSourceConnection(source.GetOutputPort())
    actor = made("Actor", Mapper=mapper, Position=place(i))
    actor.GetProperty().SetColor(0.9, 0.4, 0.2)
    actor.GetProperty().SetSpecular(0.3)
    renderer.AddActor(actor)
    return actor


def glyphs():
    """One source at many points: with and without normals, of one colour, scaled along the axes, clipped."""
    ball = made("SphereSource", ThetaResolution=12, PhiResolution=10)
    glyph(0, ball)
    clip(glyph(1, made("ConeSource", Resolution=7)), 1, (-1, 0.3, -0.2))
    plain = glyph(2, made("CubeSource"), size=0.1)
    plain.GetMapper().ScalarVisibilityOff()
    plain.SetScale(1, 0.7, 0.8)
    clip(glyph(3, ball), 3, (0.2, -1, 0.3))


def two_sided_glyphs():
    """Clipped, so that back faces are seen, which have their own material."""
    for i in range(4):
        actor = glyph(i, made("ConeSource", Resolution=7) if i % 2 else made("SphereSource"), size=0.4, count=3)
        actor.SetBackfaceProperty(made("Property", Color=(0.1, 0.8, 0.3), Specular=0.2))
        clip(actor, i, (0.2, -1, 0.3))


def lit_glyphs():
    """The same under lamps and without light, and physically based."""
    lights()
    renderer.RemoveAllViewProps()
    ball = made("SphereSource", ThetaResolution=12, PhiResolution=10)
    glyph(0, ball)
    glyph(1, made("ConeSource", Resolution=7))
    metal(glyph(2, ball))
    glyph(3, ball).GetProperty().LightingOff()


def translucent_glyphs():
    ball = made("SphereSource", ThetaResolution=12, PhiResolution=10)
    glyph(0, ball, count=3, size=0.3).GetProperty().SetOpacity(0.4)
    glyph(3, made("ConeSource", Resolution=7)).GetProperty().SetOpacity(0.6)
    sphere(0, radius=0.3)


def peeled_glyphs():
    translucent_glyphs()
    renderer.SetUseDepthPeeling(1)
    renderer.SetMaximumNumberOfPeels(50)
    renderer.SetOcclusionRatio(0.0)


globals()[kind]()
show(renderer, samples, frames)

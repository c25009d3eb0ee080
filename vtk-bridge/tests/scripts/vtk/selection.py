# Picks by prop, cell, point and depth, hardware selection of cells and points, and points that are visible.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.2)
props = []
for i in range(3):
    source = vtk.vtkSphereSource()
    source.SetCenter(0.8 * i, 0.3 * (i % 2), 0)
    source.SetThetaResolution(12)
    source.SetPhiResolution(12)
    props.append(actor(source, ((0.9, 0.2, 0.2), (0.2, 0.9, 0.2), (0.2, 0.2, 0.9))[i]))
    ren.AddActor(props[-1])
props[1].GetProperty().SetOpacity(1)
win = window(320, 240, ren)
look(ren, (0.8, -4, 1), (0.8, 0, 0)).Zoom(1.4)
ren.ResetCameraClippingRange()
win.Render()
save(win, "before")


def index(prop):
    return next((i for i, known in enumerate(props) if known is prop), None)


picks = []
for x, y in ((80, 110), (160, 125), (240, 110), (5, 5), (120, 118)):
    prop_picker, cell_picker = vtk.vtkPropPicker(), vtk.vtkCellPicker()
    point_picker, world = vtk.vtkPointPicker(), vtk.vtkWorldPointPicker()
    found = prop_picker.Pick(x, y, 0, ren)
    picks.append(["prop", found, index(prop_picker.GetActor())])
    found = cell_picker.Pick(x, y, 0, ren)
    picks.append(["cell", found, cell_picker.GetCellId(), index(cell_picker.GetActor())])
    point_picker.SetTolerance(0.02)
    found = point_picker.Pick(x, y, 0, ren)
    picks.append(["point", found, point_picker.GetPointId(), index(point_picker.GetActor())])
    world.Pick(x, y, 0, ren)
    # Equal window depths within an ulp or two give the same position to about six digits.
    picks.append(["world"] + [round(v, 4) + 0.0 for v in world.GetPickPosition()])

selections = []
for association in (vtk.vtkDataObject.FIELD_ASSOCIATION_CELLS, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS):
    for area in ((0, 0, 319, 239), (100, 90, 180, 150), (0, 0, 4, 4)):
        selector = vtk.vtkHardwareSelector()
        selector.SetRenderer(ren)
        selector.SetFieldAssociation(association)
        selector.SetArea(*area)
        selected = selector.Select()
        nodes = []
        for n in range(selected.GetNumberOfNodes() if selected else 0):
            node = selected.GetNode(n)
            ids = node.GetSelectionList()
            prop = index(node.GetProperties().Get(vtk.vtkSelectionNode.PROP()))
            nodes.append([prop, sorted(ids.GetValue(k) for k in range(ids.GetNumberOfTuples()))])
        selections.append(sorted(nodes, key=str))
win.Render()
visible = vtk.vtkSelectVisiblePoints()
visible.SetInputConnection(props[0].GetMapper().GetInputConnection(0, 0))
visible.SetRenderer(ren)
visible.SetTolerance(0.002)
visible.Update()
picked_area = vtk.vtkRenderedAreaPicker()
picked_area.AreaPick(60, 60, 200, 200, ren)
area_props = picked_area.GetProp3Ds()
win.Render()
save(
    win,
    "after",
    picks=picks,
    selections=selections,
    visible=visible.GetOutput().GetNumberOfPoints(),
    area=area_props.GetNumberOfItems() if area_props else 0,
    z=round(ren.GetZ(80, 110), 5),
)

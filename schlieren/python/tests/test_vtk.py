"""Data sets of VTK and PyVista."""

import numpy as np
import pytest
import schlieren
from flows import field, render, same, warm

pyvista = pytest.importorskip("pyvista")

NODES, STEP = 24, 0.1 / 23


def image():
    grid = pyvista.ImageData(dimensions=[NODES] * 3, spacing=[STEP] * 3)
    grid["rho"] = warm(NODES).ravel(order="F")
    return grid


def test_image_data_have_the_bits_of_numpy():
    of = schlieren.Field.from_vtk(image(), density="rho")
    assert same(render(of), render(field(NODES)))


@pytest.mark.filterwarnings("ignore::schlieren.SchlierenWarning")
@pytest.mark.parametrize(
    "kind", ["rectilinear", "structured", "unstructured", "polyhedra", "blocks"]
)
def test_every_kind_is_the_same_flow(kind):
    grid = image()
    if kind == "rectilinear":
        x = STEP * np.arange(NODES)
        made = pyvista.RectilinearGrid(x, x, x)
        made["rho"] = grid["rho"]
    elif kind == "structured":
        made = grid.cast_to_structured_grid()
    elif kind == "unstructured":
        made = grid.cast_to_unstructured_grid()
    elif kind == "blocks":
        made = pyvista.MultiBlock([grid, None])
    else:
        made = polyhedra(grid)
    # Nodes where the points are, so that nothing is lost between them.
    lattice = {"resample_nodes": NODES, "reconstruction": "linear"}
    found = render(schlieren.Field.from_vtk(made, density="rho", **lattice))
    expected = render(field(NODES))
    largest = expected.report.largest_deflection_rad
    difference = np.abs(found.deflection_rad - expected.deflection_rad)
    assert difference[4:-4, 4:-4].max() < 0.03 * largest


def polyhedra(grid):
    """The cells of a lattice as polyhedra of six faces, and one hexahedron."""
    import vtk

    hexahedra = grid.cast_to_unstructured_grid()
    made = vtk.vtkUnstructuredGrid()
    made.SetPoints(hexahedra.GetPoints())
    faces = [(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)]
    corners = hexahedra.cells_dict.get(12)
    if corners is None:
        corners = hexahedra.cells_dict[11][:, [0, 1, 3, 2, 4, 5, 7, 6]]
    made.InsertNextCell(vtk.VTK_HEXAHEDRON, 8, [int(c) for c in corners[0]])
    for cell in corners[1:]:
        stream = vtk.vtkIdList()
        for value in [6, *(v for face in faces for v in (4, *(int(cell[c]) for c in face)))]:
            stream.InsertNextId(value)
        made.InsertNextCell(vtk.VTK_POLYHEDRON, stream)
    made = pyvista.wrap(made)
    made["rho"] = grid["rho"]
    return made


def test_components_cells_and_turned_axes():
    grid = image()
    grid["both"] = np.column_stack([grid["rho"], 0 * grid["rho"]])
    assert same(
        render(schlieren.Field.from_vtk(grid, density="both:0")),
        render(schlieren.Field.from_vtk(grid, density="rho")),
    )
    cells = image().point_data_to_cell_data()
    report = render(schlieren.Field.from_vtk(cells, density="rho")).report
    # Averages over NODES - 1 cells become values at the cells' corners.
    assert report.grid == (NODES,) * 3


@pytest.mark.filterwarnings("ignore::schlieren.SchlierenWarning")
def test_hidden_cells_block_light():
    grid = image()
    hidden = np.zeros(grid.n_cells, dtype=np.uint8)
    hidden[: grid.n_cells // 8] = 32
    grid.cell_data["vtkGhostType"] = hidden
    of = schlieren.Field.from_vtk(grid, density="rho", hidden="solid")
    assert render(of).transmission.min() == 0


def test_names_and_kinds_that_are_not_there():
    with pytest.raises(ValueError, match="'roh'.*did you mean 'rho'"):
        schlieren.Field.from_vtk(image(), density="roh")
    with pytest.raises(TypeError, match="density is ndarray; give the name"):
        schlieren.Field.from_vtk(image(), density=warm(NODES))
    surface = pyvista.Sphere()
    surface["rho"] = np.ones(surface.n_points)
    with pytest.raises(TypeError, match="vtkPolyData, which has no volume"):
        schlieren.Field.from_vtk(surface, density="rho")

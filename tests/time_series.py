# SPDX-License-Identifier: MIT
"""Readers of time series, as simple as the formats allow: XML and numbers, and VTK itself."""

import xml.etree.ElementTree as ET

import numpy as np


class Series:
    """A time series: points and cells of its mesh, fields of each time by name."""

    def __init__(self):
        self.times, self.at_points, self.in_cells = [], [], []
        self.points = self.cells = None

    def add(self, time, mesh):
        """Add a time with a mesh of VTK; the reader deletes its arrays with the next one."""
        self.times.append(time)
        self.points = np.array(mesh.points)
        self.cells = np.array(mesh.cell_connectivity).reshape(-1, 2)
        self.at_points.append({name: np.array(mesh.point_data[name]) for name in mesh.point_data})
        self.in_cells.append({name: np.array(mesh.cell_data[name]) for name in mesh.cell_data})

    def of(self, name):
        """The values of a field at all times."""
        kept = self.at_points if name in self.at_points[0] else self.in_cells
        return np.array([fields[name] for fields in kept])

    @property
    def names(self):
        return [*self.at_points[0], *self.in_cells[0]]


def read_xdmf(path):
    """All steps of an XDMF file; the mesh must be that of the first in each of them."""
    series = Series()

    def numbers(item):
        assert item.attrib["Format"] == "XML"
        assert item.attrib["Precision"] == "8"
        shape = [int(n) for n in item.attrib["Dimensions"].split()]
        kind = {"Int": int, "Float": float}[item.attrib["NumberType"]]
        return np.array([kind(n) for n in item.text.split()], kind).reshape(shape)

    (collection,) = ET.parse(path).getroot().findall("Domain/Grid")
    assert collection.attrib["CollectionType"] == "Temporal"
    for n, numbering in enumerate(collection.findall("Grid")):
        assert numbering.attrib == {"Name": str(n), "GridType": "Uniform"}
        series.times.append(float(numbering.find("Time").attrib["Value"]))
        cells, points = (
            numbers(numbering.find(f"{what}/DataItem")) for what in ("Topology", "Geometry")
        )
        assert len(cells) == int(numbering.find("Topology").attrib["NumberOfElements"])
        assert series.cells is None or (cells == series.cells).all()
        assert series.points is None or (points == series.points).all()
        series.cells, series.points = cells, points
        fields = {"Node": {}, "Cell": {}}
        for one in numbering.findall("Attribute"):
            values = numbers(one.find("DataItem"))
            assert one.attrib["AttributeType"] == ("Vector" if values.ndim == 2 else "Scalar")
            fields[one.attrib["Center"]][one.attrib["Name"]] = values
        assert {len(values) for values in fields["Node"].values()} == {len(points)}
        assert {len(values) for values in fields["Cell"].values()} == {len(cells)}
        series.at_points.append(fields["Node"])
        series.in_cells.append(fields["Cell"])
    return series


def read_vtkhdf(path):
    """All steps of a VTKHDF file by the reader of VTK, as PyVista shows them."""
    import pyvista
    import vtkmodules.vtkIOHDF

    reader = vtkmodules.vtkIOHDF.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    series = Series()
    for n in range(reader.GetNumberOfSteps()):
        reader.SetStep(n)
        reader.Update()
        mesh = pyvista.wrap(reader.GetOutput()).copy()
        assert set(mesh.celltypes) == {pyvista.CellType.LINE}
        series.add(reader.GetTimeValue(), mesh)
    return series


def read_as_users_do(path):
    """All steps of a file by PyVista (``.hdf``) or meshio (``.xdmf``), opened in one line."""
    import pytest

    series = Series()
    if path.suffix == ".hdf":
        import pyvista

        first = pyvista.read(path)
        reader = pyvista.get_reader(path)
        for n in range(reader.reader.GetNumberOfSteps()):
            reader.reader.SetStep(n)
            mesh = reader.read()
            series.add(reader.reader.GetTimeValue(), mesh)
        for name, values in (series.at_points[0] | series.in_cells[0]).items():
            assert (first[name] == values).all()  # the file opens at its first time
        return series
    meshio = pytest.importorskip("meshio")
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        series.points, (block,) = reader.read_points_cells()
        series.cells = block.data
        for n in range(reader.num_steps):
            t, at_points, in_cells = reader.read_data(n)
            series.times.append(t)
            series.at_points.append(at_points)
            series.in_cells.append({name: values for name, (values,) in in_cells.items()})
    assert block.type == "line"
    return series


def require_equal(one, other):
    """Both series have the same numbers, to the last bit."""
    assert one.times == other.times
    assert (one.points == other.points).all()
    assert (one.cells == other.cells).all()
    assert sorted(one.names) == sorted(other.names)
    for name in one.names:
        assert (one.of(name) == other.of(name)).all()

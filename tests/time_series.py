# SPDX-License-Identifier: MIT
"""Readers of time series, as simple as the formats allow: XML and numbers, and VTK itself."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np


@dataclass
class Series:
    """A time series: points and cells of its mesh, fields of each time by name."""

    times: list
    points: np.ndarray
    cells: np.ndarray
    at_points: list
    in_cells: list

    def of(self, name):
        """The values of a field at all times."""
        kept = self.at_points if name in self.at_points[0] else self.in_cells
        return np.array([fields[name] for fields in kept])

    @property
    def names(self):
        return [*self.at_points[0], *self.in_cells[0]]


def read_xdmf(path):
    """All steps of an XDMF file; the mesh must be that of the first in each of them."""
    data = (path.parent / f"{path.name}.bin").read_bytes()
    series = Series([], None, None, [], [])

    def numbers(item):
        assert item.attrib["Format"] == "Binary"
        assert item.attrib["Endian"] == "Little"
        assert item.attrib["Precision"] == "8"
        assert item.text == f"{path.name}.bin"
        shape = [int(n) for n in item.attrib["Dimensions"].split()]
        kind, at = {"Int": "<i8", "Float": "<f8"}[item.attrib["NumberType"]], item.attrib["Seek"]
        return np.frombuffer(data, kind, int(np.prod(shape)), int(at)).reshape(shape)

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
    series = Series([], None, None, [], [])
    for n in range(reader.GetNumberOfSteps()):
        reader.SetStep(n)
        reader.Update()
        # Where the next step is read, arrays of the one before are gone.
        mesh = pyvista.wrap(reader.GetOutput()).copy()
        assert set(mesh.celltypes) == {pyvista.CellType.LINE}
        series.times.append(reader.GetTimeValue())
        series.points = np.array(mesh.points)
        series.cells = np.array(mesh.cell_connectivity).reshape(-1, 2)
        series.at_points.append({name: np.array(mesh.point_data[name]) for name in mesh.point_data})
        series.in_cells.append({name: np.array(mesh.cell_data[name]) for name in mesh.cell_data})
    return series

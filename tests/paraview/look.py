# SPDX-License-Identifier: MIT
"""pvpython look.py FILE READER: one data set with all fields, and a picture of them.

In the folder of the file, beside ``expected.json``; the picture, warped and coloured by M, is
FILE.READER.png.
"""

import json
import os
import sys

from paraview import servermanager, simple
from vtkmodules.vtkIOImage import vtkPNGReader

name, reader_name = sys.argv[1:]
path = os.path.abspath(name)  # Xdmf3 readers abort with a name that has no directory
with open("expected.json") as file:
    expected = json.load(file)
make = getattr(simple, reader_name)
reader = make(FileNames=[path]) if reader_name == "XDMFReader" else make(FileName=path)
reader.UpdatePipelineInformation()
times = list(reader.TimestepValues)
assert len(times) == expected["times"], times
reader.UpdatePipeline(times[-1])


def fields_of(data):
    """Largest size of each field at points and in cells of the one data set that there must be."""
    assert data.GetClassName() == "vtkUnstructuredGrid", data.GetClassName()
    found = {}
    for fields in (data.GetPointData(), data.GetCellData()):
        for k in range(fields.GetNumberOfArrays()):
            found[fields.GetArrayName(k)] = max(map(abs, fields.GetArray(k).GetRange(-1)))
    return found


data = servermanager.Fetch(reader)
found = fields_of(data)
print(f"{name} by {reader_name}: {len(times)} times")
size = f"{data.GetNumberOfPoints()} points, {data.GetNumberOfCells()} cells"
print(f"  one {data.GetClassName()}, {size}: {', '.join(sorted(found))}")
for field in (
    "displacement",
    "rotation",
    "velocity",
    "N",
    "V",
    "M",
    "jump",
    "dissipated energy",
    "part",
):
    assert found[field] > 0, field
for field in ("displacement", "rotation", "M", "jump"):
    assert abs(found[field] - expected[field]) < 1e-9 * expected[field], (field, found[field])
assert found["part"] == 2.0

warped = simple.WarpByVector(Input=reader)
warped.Vectors = ["POINTS", "displacement"]
warped.ScaleFactor = 5.0
warped.UpdatePipeline(times[-1])
assert fields_of(servermanager.Fetch(warped))["M"] == found["M"]

view = simple.CreateView("RenderView")
view.ViewSize, view.OrientationAxesVisibility, view.UseColorPaletteForBackground = [1200, 800], 0, 0
view.Background = [1.0, 1.0, 1.0]
slider = simple.GetAnimationScene()
slider.UpdateAnimationUsingDataTimeSteps()
before = simple.Show(reader, view)
before.DiffuseColor = before.AmbientColor = [0.6, 0.6, 0.6]
before.ColorArrayName, before.LineWidth = [None, ""], 2
shown = simple.Show(warped, view)
simple.ColorBy(shown, ("CELLS", "M"))
slider.GoToLast()
# RescaleTransferFunctionToDataRange() would keep the range of the first time: 0 to 1e-38
simple.GetColorTransferFunction("M").RescaleTransferFunction(-found["M"], found["M"])
shown.LineWidth, shown.RenderLinesAsTubes = 6, 1
bar = simple.GetScalarBar(simple.GetColorTransferFunction("M"), view)
bar.TitleColor = bar.LabelColor = [0.0, 0.0, 0.0]
shown.SetScalarBarVisibility(view, True)
simple.ResetCamera(view)
picture = f"{name}.{reader_name}.png"
simple.SaveScreenshot(picture, view)

png = vtkPNGReader()
png.SetFileName(picture)
png.Update()
pixels = png.GetOutput().GetPointData().GetScalars()
colours = {}
for k in range(pixels.GetNumberOfTuples()):
    colour = pixels.GetTuple(k)
    colours[colour] = colours.get(colour, 0) + 1
background = max(colours.values())
drawn = pixels.GetNumberOfTuples() - background
assert drawn > 5000, f"the picture is blank: {drawn} pixels"
assert len(colours) > 100, f"the picture has {len(colours)} colours"

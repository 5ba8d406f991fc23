# SPDX-License-Identifier: MIT
"""pvpython look_at_blocks.py FILE: the file of demo_the_card.py, which DOLFINx wrote.

DOLFINx writes a grid for each function, so the reader returns a block for each.  The file does not
state the precision of its numbers, and the reader takes them as single.
"""

import math
import os
import sys

from paraview import servermanager, simple

reader = simple.Xdmf3ReaderT(FileName=os.path.abspath(sys.argv[1]))
reader.UpdatePipelineInformation()
times = list(reader.TimestepValues)
assert len(times) == 50, times
reader.UpdatePipeline(times[-1])
blocks, found = servermanager.Fetch(reader), {}
for k in range(blocks.GetNumberOfBlocks()):
    block = blocks.GetBlock(k)
    assert (block.GetNumberOfPoints(), block.GetNumberOfCells()) == (18, 17)
    for fields in (block.GetPointData(), block.GetCellData()):
        for i in range(fields.GetNumberOfArrays()):
            found[fields.GetArrayName(i)] = max(map(abs, fields.GetArray(i).GetRange(-1)))
print(f"{sys.argv[1]}: {len(times)} times, {', '.join(sorted(found))}")
assert abs(found["rotation"] - 4 * math.pi) < 1e-6
assert abs(found["jump"] - 3.533765992932) < 1e-6
M = 80 * math.exp(-80 / 100 * found["jump"])  # of the hinge; N m
assert abs(found["N V M"] - M) < 1e-5 * M
assert found["displacement"] > 0.5
assert found["plastic curvature"] > 5

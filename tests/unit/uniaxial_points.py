# SPDX-License-Identifier: MIT
"""Bars of one material point each, whose strains are given."""

import numpy as np

from ufl_beam.blocks.material_points import Points
from ufl_beam.model.fibres import SectionPoints

C, LENGTH = 200.0, 0.5


class Bars:
    """Cells with one point each that the axial strain strains; all else has no stiffness."""

    def __init__(self, cells, bulk, softening, scheme, *, C=C, length=LENGTH):
        section_points = SectionPoints(
            strains=np.array([[1.0, 0.0, 0.0]]),
            weights=np.ones(1),
            stiffness=np.array([C]),
            laws=((bulk, 1),),
            rest=np.zeros(3),
            softening=softening,
            breaking=slice(None),
            hinges=True,
        )
        self.C, self.length, self.scheme, self.softening = C, length, scheme, softening
        self.parameters = section_points.parameters([(0, k) for k in range(cells)])
        keys = [(0, k) for k in range(cells)]
        self.points = Points(section_points, keys, np.full(cells, length), scheme)
        self.strain = np.zeros(cells)

    def __getitem__(self, name):
        state = f"state {name}"
        return self.points[state if state in self.points.names else name][:, 0].copy()

    def _strains(self, strain):
        return np.column_stack([strain, np.zeros((len(strain), 2))])

    def return_map(self, strain, dt=0.1):
        """Stresses of a step to `strain`, and their derivatives."""
        self.points.start(self._strains(self.strain))
        self.points.begin(dt)
        r, D = self.points.return_map(self._strains(np.asarray(strain)))
        return r[:, 0].copy(), D[:, 0].copy()

    def step(self, strain, dt=0.1):
        """The same, and the end becomes the state."""
        σ, _ = self.return_map(strain, dt)
        self.points.accept()
        self.strain = np.asarray(strain).copy()
        return σ

    def stress(self):
        """In the accepted state."""
        return self.points.recorded[:, 0].copy()

    def dissipated(self):
        """By plastic strains and by discontinuities, of each cell."""
        return self.points.recorded[:, 4].copy(), self.points.recorded[:, 5].copy()


def histories(cells, steps=20, seed=0, size=0.06):
    """Random walks of strains, those of the first cells within the elastic range."""
    random = np.random.default_rng(seed)
    walks = np.cumsum(random.uniform(-1, 1, (steps, cells)), axis=0)
    return walks * size * np.linspace(0.01, 1, cells)

# SPDX-License-Identifier: MIT
"""Scripts of users: type checkers accept them, as the package is marked as typed."""

from pathlib import Path

import pytest

import ufl_beam as ub

api = pytest.importorskip("mypy.api")

SCHEMES = [
    "Static()", "EnergyMomentumStatic(0.7)", "EnergyMomentum()", "EnergyMomentum(alpha=0.05)",
    "EnergyMomentumDecaying()", "EnergyMomentumPrinted()", "Newmark()", "GeneralizedAlpha()",
]  # fmt: skip

SCRIPT = """
import ufl_beam as ub

def compare(scene: ub.Scene) -> list[ub.Solution]:
    return [
        {runs}
    ]
"""


def test_a_script_with_all_schemes_passes(tmp_path):
    """Protocols must not ask for attributes that can be set: frozen schemes have none."""
    runs = ",\n        ".join(f"ub.simulate(scene, ub.{s}, t=(0, 1), dt=0.1)" for s in SCHEMES)
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(runs=runs))
    settings = Path(ub.__file__).parents[1] / "pyproject.toml"
    text, errors, status = api.run(["--config-file", str(settings), str(script)])
    assert status == 0, text + errors

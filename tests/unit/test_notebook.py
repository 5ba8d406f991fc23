# SPDX-License-Identifier: MIT
"""The notebook of docs: runs as a script, and in a kernel that shows tables and pictures."""

import runpy
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial

SCRIPT = Path(__file__).parents[2] / "docs" / "notebooks" / "first_steps.py"


def test_the_notebook_runs_as_a_script(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        names = runpy.run_path(str(SCRIPT))
    except ImportError as missing:  # of PyVista or imageio
        pytest.skip(str(missing))
    assert names["solution"].energy.worst < 1e-9  # the ledger closes
    assert names["damaged"].energy["hinges"][-1] > 1e3  # J
    assert names["tradeoff"].ratio(names["tradeoff"].best) <= 1  # the tolerance is met
    assert (tmp_path / "first_steps.gif").stat().st_size > 1000


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """Outputs of the cells of code of the executed notebook, by their last lines."""
    optional = "jupytext", "nbclient", "ipykernel", "pyvista", "imageio"
    jupytext, nbclient, *_ = map(pytest.importorskip, optional)
    notebook = jupytext.read(SCRIPT)
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3"}
    folder = {"metadata": {"path": str(tmp_path_factory.mktemp("notebook"))}}
    nbclient.NotebookClient(notebook, timeout=600, resources=folder).execute()
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    return {cell.source.splitlines()[-1]: cell.outputs for cell in code}


def shown(outputs):
    """Representations of the value that a cell ends with."""
    (result,) = (one for one in outputs if one.output_type == "execute_result")
    return result.data


def test_models_and_results_have_a_page(cells):
    for name in ("scene", "modes", "solution", "damaged", "tradeoff"):
        data = shown(cells[name])
        assert data["text/plain"].startswith("<"), name
        assert "\n" not in data["text/plain"], name
        assert data["text/html"].count("data:image/png") == 1, name
        assert "no picture" not in data["text/html"], name


def test_figures_are_pictures_and_the_film_plays(cells):
    """Without `%matplotlib inline`."""
    for quantity in ("M", "history", "energy", "hinge"):
        (source,) = (x for x in cells if x.startswith("ub.plot(") and f'"{quantity}"' in x)
        data = shown(cells[source])
        assert data["image/png"].startswith("iVBOR")  # the first bytes of PNG
        assert "text/html" not in data
    (source,) = (source for source in cells if source.startswith("ub.animate"))
    assert "data:image/gif;base64," in shown(cells[source])["text/html"]


def test_nothing_else_is_printed(cells):
    """No warnings; bars of progress, where they are text, go to the output of errors."""
    streams = [one for each in cells.values() for one in each if one.output_type == "stream"]
    printed = [one.text for one in streams if one.name == "stdout"]
    assert printed == ["largest drift 44.7 mm at t = 0.113 s\n"]
    assert not any("Warning" in one.text for one in streams)

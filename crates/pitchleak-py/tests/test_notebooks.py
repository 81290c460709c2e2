"""Each notebook runs from top to bottom; its own cells assert what it claims."""

import os

import pytest
from conftest import ROOT

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")

FOLDER = ROOT / "examples" / "notebooks"
MEASURED = ROOT.parent / "shared" / "data" / "measured" / "eha"


def run(name, **environment):
    """Every cell, as a reader would run them; the notebook with what they print."""
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells), "stored outputs go stale"
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(FOLDER)}})
    client.execute(env={**os.environ, **environment})
    return "".join(
        output.get("text", "") for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs
    )


@pytest.mark.parametrize("name", ["farm_month", "foreign_logger"])
def test_a_notebook_runs(name):
    assert run(name)


def test_residual_to_effect_on_measured_data():
    if not (MEASURED / "rig.toml").exists():
        pytest.skip("the measured traces are no part of this project: examples/measured_rig.py makes them")
    assert "held-out" in run("measured_residual", MEASURED_TRACES=str(MEASURED))

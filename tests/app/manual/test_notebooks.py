"""The notebooks run from the first to the last cell."""

from __future__ import annotations

import json
import time
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
from rodsight.manual.contents import FOLDER
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from tests.program import ROOT

FEWER_RUNS = "[0.15, 0.2, 0.25, 0.3, 0.4]", "[0.15, 0.25, 0.4]"  # of the parameter study: each is a process of its own
SECONDS = 600  # for a cell, including the compilation of kernels

NOTEBOOKS = sorted((FOLDER / "notebooks").glob("*.ipynb"))
FIRST_FIRST = sorted(NOTEBOOKS, key=lambda file: file.stem != "from_photographs_to_forces")  # others use its run


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Working folder of the notebooks; later ones use the run of the first."""
    folder = tmp_path_factory.mktemp("notebooks")
    (folder / "sample_data").symlink_to(ROOT / "sample_data", target_is_directory=True)
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a smaller experiment instead of the sample: enough photographs, fewer rods."""
    folder = tmp_path_factory.mktemp("small")
    synthesize(folder / "sample_data" / "shear", SynthesisSettings(grains=40, frames=12, seed=2))
    return folder


def test_the_parameter_study_is_found_that_runs_with_fewer_values():
    assert FEWER_RUNS[0] in (FOLDER / "notebooks/study_of_a_parameter.ipynb").read_text(encoding="utf-8")


def test_there_are_four_without_outputs_and_the_page_names_them():
    nbformat = pytest.importorskip("nbformat", reason="needs the extra notebooks")
    page = (FOLDER / "python.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 4
    for file in NOTEBOOKS:
        assert file.name in page
        book = nbformat.read(file, 4)
        nbformat.validate(book)
        assert not any(cell.get("outputs") for cell in book.cells)


@pytest.mark.thorough  # many seconds
@pytest.mark.parametrize(
    "file",
    [
        pytest.param(file, marks=[pytest.mark.slow] if file.stem == "study_of_a_parameter" else [])
        for file in FIRST_FIRST
    ],
    ids=lambda file: file.stem,
)
def test_the_cells_of_a_notebook_run_on_a_small_experiment(file, small, monkeypatch, capsys):
    monkeypatch.chdir(small)
    mpl.use("agg")
    shown: list[object] = []
    names = {"display": shown.append}
    text = file.read_text(encoding="utf-8")
    for number, cell in enumerate(json.loads(text.replace(*FEWER_RUNS))["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{file.name}, cell {number}", "exec"), names)
    plt.close("all")
    capsys.readouterr()


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the kernel and its channels
@pytest.mark.parametrize("file", FIRST_FIRST, ids=lambda file: file.stem)
def test_a_notebook_runs(file, folder, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="needs the extra notebooks")
    nbformat = pytest.importorskip("nbformat", reason="needs the extra notebooks")
    monkeypatch.setenv("PYTHONPATH", f"{ROOT / '.editable'}")
    book = nbformat.read(file, 4)
    began = time.perf_counter()
    nbclient.NotebookClient(book, timeout=SECONDS, resources={"metadata": {"path": str(folder)}}).execute()
    assert time.perf_counter() - began < SECONDS
    shown = [output for cell in book.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in shown)
    assert not any(output["output_type"] == "error" for output in shown)

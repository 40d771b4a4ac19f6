"""The notebooks run from the first to the last cell, as somebody runs them who has the source."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from rodsight.manual.contents import FOLDER

from tests.program import ROOT

SECONDS = 600  # for a cell, kernels compiled

NOTEBOOKS = sorted((FOLDER / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where they are started; what the first has run the second finds."""
    folder = tmp_path_factory.mktemp("notebooks")
    (folder / "sample_data").symlink_to(ROOT / "sample_data", target_is_directory=True)
    return folder


def test_there_are_three_without_outputs_and_the_page_names_them():
    nbformat = pytest.importorskip("nbformat", reason="needs the extra notebooks")
    page = (FOLDER / "python.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 3
    for file in NOTEBOOKS:
        assert file.name in page
        book = nbformat.read(file, 4)
        nbformat.validate(book)
        assert not any(cell.get("outputs") for cell in book.cells)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the kernel and its channels
@pytest.mark.parametrize("file", sorted(NOTEBOOKS, key=lambda file: file.stem != "from_photographs_to_forces"),
                         ids=lambda file: file.stem)  # fmt: skip
def test_a_notebook_runs(file, folder, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="needs the extra notebooks")
    nbformat = pytest.importorskip("nbformat", reason="needs the extra notebooks")
    monkeypatch.setenv("PYTHONPATH", f"{ROOT / '.editable'}:{ROOT}")
    book = nbformat.read(file, 4)
    began = time.perf_counter()
    nbclient.NotebookClient(book, timeout=SECONDS, resources={"metadata": {"path": str(folder)}}).execute()
    assert time.perf_counter() - began < SECONDS
    shown = [output for cell in book.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in shown)
    assert not any(output["output_type"] == "error" for output in shown)

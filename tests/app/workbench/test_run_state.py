"""The run as the page states it: drawn at its own scale, and never good where photographs failed."""

import json
import shutil

import h5py
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.run_folder import SUMMARY, Run
from rodsight.workbench.inspecting.run_overview import run_overview
from rodsight.workbench.service.workbench import Workbench

from tests.app.workbench.conftest import Visitor
from tests.golden.stored import unpack

PIXEL = 2.5e-4  # [m]
FRAME = 3


@pytest.fixture
def solved(visitor, photographs_only):
    """A visitor, where the experiment is, and the folder of its run, whose frame 0 is photograph 2."""
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=PIXEL)
    run = photographs_only / "runs" / "mine"
    run.mkdir(parents=True)
    unpack(2, run)
    return visitor, at, run


def test_a_run_is_drawn_at_the_scale_that_it_was_made_with(solved):
    visitor, at, run = solved
    with h5py.File(run / "results.h5", "r+") as store:
        store.attrs["configuration"] = f'[photographs]\nfiles = "*.jpg"\npixel_size = {PIXEL}\ninterval = 30.0\n'
    before = visitor.request("network", at=at, frame=FRAME)["rods"]
    visitor.request("set_scale", at=at, pixel_size=10.0 * PIXEL)
    after = visitor.request("network", at=at, frame=FRAME)["rods"]
    assert after["x"] == pytest.approx(before["x"])
    assert after["r"] == pytest.approx(before["r"])


def test_tracks_are_drawn_at_the_scale_that_they_were_made_with(spoiled):
    visitor = Visitor(Workbench(spoiled)).enter()
    before = visitor.request("poses", at="mine", frame=1)["rods"]
    visitor.request("set_scale", at="mine", pixel_size=10.0 * visitor.request("project", at="mine")["pixel"])
    assert visitor.request("poses", at="mine", frame=1)["rods"] == before


def summarise(run, **values):
    (run / SUMMARY).write_text(json.dumps({"frame_count": 3, "trust": [0.9], **values}))
    return run_overview(run)["faults"]


def test_failed_photographs_are_faults_by_their_number_in_the_experiment(solved):
    *_, run = solved
    assert summarise(run, status_count={"reset": 1, "settled": 2}) == []
    assert summarise(run, status_count={"settled": 2, "failed": 1}, failures={"1": "0 of 30 grains are found"}) == [
        "Photograph 3 has no forces: 0 of 30 grains are found."
    ]
    many = summarise(run, status_count={"settled": 2}, failures={str(k): "dark" for k in range(9)})
    assert (len(many), many[-1]) == (6, "4 more have none.")


def test_a_run_without_a_usable_frame_is_not_good(solved):
    *_, run = solved
    assert summarise(run, status_count={"reset": 1, "suspect": 2})[0].startswith("Every frame is suspect")
    assert summarise(run, status_count={"reset": 1}) == []


def test_a_copied_experiment_needs_another_name(made_tracks, tmp_path):
    for name in ("first", "copy"):
        shutil.copytree(made_tracks, tmp_path / name)
    run = Run(load_experiment(tmp_path / "first"), tmp_path / "runs" / load_experiment(tmp_path / "first").name)
    run.claim()
    visitor = Visitor(Workbench(tmp_path)).enter()
    assert "holds the run of" not in str(visitor.request("project", at="first")["steps"])
    described = visitor.request("project", at="copy")
    assert "holds the run of first: give this experiment another name" in described["steps"][0]["messages"][0]
    assert not described["ready"]
    visitor.request("set_photographs", at="copy", name="copy")
    assert "holds the run of" not in str(visitor.request("project", at="copy")["steps"])


def test_what_the_diagnosis_found_is_a_fault_unless_the_run_has_corrected_it(solved):
    *_, run = solved
    found = {"cause": "rotation_sign", "evidence": "rods roll backwards", "effect": "rolling is taken for sliding",
             "cure": "change the sign of theta"}  # fmt: skip
    sentence = "Rotation sign: rods roll backwards; rolling is taken for sliding. Cure: change the sign of theta."
    assert summarise(run, status_count={"settled": 3}, diagnosis=[found]) == [sentence]  # as earlier versions wrote it
    assert run_overview(run)["causes"] == 1
    assert summarise(run, status_count={"settled": 3}, diagnosis=[found | {"corrected": True}]) == []
    assert (run_overview(run)["causes"], run_overview(run)["corrected"]) == (0, [f"Corrected by the run: {sentence}"])
    assert summarise(run, status_count={"settled": 3}, diagnosis=["of another program"]) == []

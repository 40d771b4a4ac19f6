"""Actions of the page as a script that repeats them; a set-up taken over for other photographs."""

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.process.errors import InputError
from rodsight.workbench.actions import Actions
from rodsight.workbench.setup.draft import Draft

BEGIN = {"folder": "my photographs/pictures", "suffix": ".jpg", "name": "mine"}


@pytest.fixture
def done(visitor, made_photographs):
    """A visitor who has set an experiment up, with a change that was undone, and where it is."""
    section = load_experiment(made_photographs).config.photographs
    at = visitor.request("begin", **BEGIN)["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=section.pixel_size)
    visitor.request("set_material", at=at, density=2700.0, friction=0.3)
    visitor.request("set_material", at=at, density=9999.0)
    visitor.request("undo", at=at)
    visitor.request("detect_rods", at=at, radii=list(section.radii))
    visitor.request("find_walls", at=at)
    visitor.request("set_plate", at=at, name="top", pressure=5e4)
    visitor.request("delete_rods", at=at, ids=[3])
    visitor.request("set_table", at=at, name="times", table="frame,time\n0,0\n1,20\n2,50\n3,90\n")
    return visitor, at


def files_of(folder: Path) -> dict[str, str]:
    return {name: (folder / name).read_text() for name in ("grains.csv", "walls.csv", "times.csv")}


@pytest.mark.thorough
def test_a_script_does_the_same_again(done, photographs_only, tmp_path, monkeypatch):
    visitor, at = done
    answer = visitor.request("script", at=at)
    assert answer["count"] == 8
    assert "9999" not in answer["script"]
    assert answer["script"].rstrip().endswith("test.run()")
    other = tmp_path / "again"
    shutil.copytree(photographs_only / at / "pictures", other / at / "pictures")
    shutil.copy(photographs_only / at / "times.csv", other / at)
    monkeypatch.chdir(other)
    monkeypatch.setattr(Actions, "run", lambda _: None)
    exec(compile(answer["script"], "script", "exec"), {})
    first, second = photographs_only / at, other / at
    assert files_of(first) == files_of(second)
    one, two = (tomllib.loads((folder / "experiment.toml").read_text()) for folder in (first, second))
    assert one == two


@pytest.mark.thorough
def test_changes_of_other_programs_are_named_in_the_script(done, photographs_only):
    visitor, at = done
    draft = visitor.workbench.project(at).draft
    draft.set_keys("by hand", {"material.friction": 0.1})
    assert "# by hand: not by the page" in visitor.request("script", at=at)["script"]


def test_verdicts_and_corrections_come_after_a_run():
    from rodsight.workbench.action_script import as_script
    from rodsight.workbench.setup.journal import Action

    def action(name, endpoint, **values):
        return Action(name, request={"id": name, "endpoint": endpoint, "values": values})

    script = as_script(
        [action("a", "set_material", density=1.0), action("b", "mark_lost", frame=2, id=3),
         action("c", "judge", verdict="contact"), action("d", "set_material", density=2.0)],
        at="x", name="x", files="*.png",
    )  # fmt: skip
    calls = [line.split("(")[0] for line in script.splitlines() if line.startswith("test.")]
    assert calls == ["test.set_material", "test.run", "test.mark_lost", "test.judge", "test.set_material", "test.run"]


def test_wrong_actions_are_refused(photographs_only):
    with pytest.raises(InputError):
        Actions(photographs_only, "nowhere")
    test = Actions(photographs_only, "my photographs", files="pictures/*.jpg", name="mine")
    with pytest.raises(AttributeError, match="no action fly"):
        test.fly()
    with pytest.raises(InputError, match="set_scale"):
        test.set_scale(pixel_size="large")


@pytest.mark.thorough
def test_a_set_up_is_taken_over_for_other_photographs(done, photographs_only):
    visitor, at = done
    later = photographs_only / "tuesday" / "pictures"
    shutil.copytree(photographs_only / at / "pictures", later)
    described = visitor.request("begin", folder="tuesday/pictures", suffix=".jpg", name="tuesday", like=at)
    before = visitor.request("project", at=at)
    assert described["at"] == "tuesday"
    assert described["rods"] is None
    assert "times" not in described["photographs"]
    for key in ("pixel", "material"):
        assert described[key] == before[key]
    assert [(wall["name"], wall["pressure"]) for wall in described["walls"]] == [
        (wall["name"], wall["pressure"]) for wall in before["walls"]
    ]
    for one, other in zip(described["walls"], before["walls"], strict=True):
        np.testing.assert_allclose(one["line"], other["line"], atol=0.02)
    assert Draft(photographs_only / "tuesday").data()["name"] == "tuesday"

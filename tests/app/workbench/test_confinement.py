"""The workbench touches nothing outside its root, and one bad folder takes no other with it."""

from __future__ import annotations

import json
import os
import shutil
import tomllib
import tracemalloc
from pathlib import Path

import pytest
import tomli_w
from rodsight.process.errors import InputError
from rodsight.workbench.service.project import Project
from rodsight.workbench.service.workbench import Workbench
from rodsight.workbench.setup.draft import Draft

from tests.app.experiment.tables import edit

from .conftest import HOST, Visitor


@pytest.fixture
def root(tracked: Path, tmp_path: Path) -> Path:
    """The root of a workbench with one experiment, beside a file that it must not touch."""
    (tmp_path / "root").mkdir()
    shutil.move(tracked, tmp_path / "root" / "tracked")
    (tmp_path / "secret.csv").write_text("frame,wall,x1,y1,x2,y2\n")
    return tmp_path / "root"


@pytest.mark.parametrize("name", ["../../secret.csv", "link.csv", "linked/secret.csv", "..", "a\0b"])
def test_no_file_outside_is_read_written_or_deleted(root, name):
    folder, secret = root / "tracked", root.parent / "secret.csv"
    (folder / "link.csv").symlink_to(secret)
    (folder / "linked").symlink_to(root.parent)
    draft, before = Draft(folder, root=root), secret.read_bytes()
    for content in (b"written", None):
        if name == "link.csv" and content is not None:
            continue
        with pytest.raises(InputError):
            draft.write("a change", {name: content})
    assert secret.read_bytes() == before


def test_a_file_of_another_folder_inside_the_root_is_found(root):
    (root / "shared.csv").write_text("x\n")
    Draft(root / "tracked", root=root).write("a change", {"../shared.csv": b"y\n"})
    assert (root / "shared.csv").read_text() == "y\n"


@pytest.mark.parametrize("name", ["../../outside", "absolute", "..", "a/b"])
def test_the_name_of_an_experiment_leads_nowhere_else(root, name):
    given = str(root.parent / "outside") if name == "absolute" else name
    edit(root / "tracked" / "experiment.toml", 'name = "tracked"', f'name = "{given}"')
    assert Project(root, root / "tracked").results == root / "runs" / "tracked"


def test_a_link_in_the_place_of_the_runs_is_refused(root):
    (root / "runs").symlink_to(root.parent)
    with pytest.raises(InputError, match="leads outside"):
        _ = Project(root, root / "tracked").results
    assert "leads outside" in Project(root, root / "tracked").overview()["error"]


def test_photographs_outside_are_not_served(made_photographs, tmp_path):
    folder = Path(shutil.copytree(made_photographs, tmp_path / "root" / "mine"))
    shutil.move(folder / "photos", tmp_path / "elsewhere")
    (folder / "photos").symlink_to(tmp_path / "elsewhere")
    project = Project(tmp_path / "root", folder)
    assert "lies outside" in " ".join(project.validation().steps["photographs"].messages)
    with pytest.raises(InputError):
        project.picture(0, 100)


def test_a_photograph_that_becomes_a_link_is_not_served(made_photographs, tmp_path):
    folder = Path(shutil.copytree(made_photographs, tmp_path / "root" / "mine"))
    project = Project(tmp_path / "root", folder)
    first = project.validation().files[0]
    shutil.move(first, tmp_path / "elsewhere.jpg")
    first.symlink_to(tmp_path / "elsewhere.jpg")
    with pytest.raises(InputError):
        project.picture(0, 100)


@pytest.mark.parametrize("way", ["above", "link", "absolute"])
@pytest.mark.parametrize("table", ["positions", "grains", "times", "file"])
def test_no_table_outside_is_read(root, table, way):
    folder = root / "tracked"
    config = tomllib.loads((folder / "experiment.toml").read_text())
    section = "walls" if table == "file" else "tracks"
    outside = root.parent / "outside.csv"
    shutil.move(folder / config[section][table], outside)
    named = {"above": "../../outside.csv", "link": "link.csv", "absolute": str(outside)}[way]
    (folder / "link.csv").symlink_to(outside)
    (folder / "experiment.toml").write_text(tomli_w.dumps(config | {section: config[section] | {table: named}}))
    visitor = Visitor(Workbench(root)).enter()
    described = visitor.request("project", at="tracked")
    messages = [text for step in described["steps"] for text in step["messages"]] + described["other_messages"]
    assert "lies outside" in " ".join(messages)
    assert not described["ready"]
    assert "lies outside" in visitor.refused("run_start", at="tracked")


def test_no_folder_outside_is_searched_for_photographs(made_photographs, tmp_path):
    folder = Path(shutil.copytree(made_photographs, tmp_path / "root" / "mine"))
    shutil.copytree(folder / "photos", tmp_path / "elsewhere")
    edit(folder / "experiment.toml", "photos/*", "../../**/*")
    described = Visitor(Workbench(tmp_path / "root")).enter().request("project", at="mine")
    assert described["files"] == []
    assert "lies outside" in " ".join(described["steps"][0]["messages"])


BAD = {
    "nested": b"name = " + b"[" * 20_000,
    "binary": b"\xff\xfe\x00",
    "huge key": b"[" + b"a." * 20_000 + b"b]\n",
}


@pytest.mark.thorough
@pytest.mark.parametrize("kind", [*BAD, "not UTF-8", "folder", "larger than memory"])
def test_a_bad_folder_is_shown_as_such_beside_the_others(root, kind):
    folder = os.fsencode(root) + (b"/b\xff\xfed" if kind == "not UTF-8" else b"/bad")
    os.mkdir(folder)
    if kind == "folder":
        os.mkdir(folder + b"/experiment.toml")
        os.mkdir(folder + b"/more")
    else:
        with open(folder + b"/experiment.toml", "wb") as file:
            file.write(BAD.get(kind, b'name = "bad"\n'))
            if kind == "larger than memory":  # and takes no disk: an archive holds it in a kilobyte
                file.truncate(100 << 20)
    tracemalloc.start()
    try:
        experiments = Visitor(Workbench(root)).enter().request("home")["experiments"]
        assert tracemalloc.get_traced_memory()[1] < 50 << 20
    finally:
        tracemalloc.stop()
    good = next(each for each in experiments if each["name"] == "tracked")
    assert "error" not in good
    if kind != "folder":
        assert next(each for each in experiments if each is not good)["error"]


def test_a_folder_that_may_not_be_entered_takes_no_other_with_it(root, monkeypatch):
    (root / "closed").mkdir()
    (root / "closed" / "inner").mkdir()
    status = Path.stat

    def refuse(place: Path, **more: bool) -> os.stat_result:
        if place.parent.name == "closed":
            raise PermissionError(13, "Permission denied", str(place))
        return status(place, **more)

    monkeypatch.setattr(Path, "stat", refuse)
    experiments = Visitor(Workbench(root)).enter().request("home")["experiments"]
    assert [each["name"] for each in experiments] == ["tracked"]


def test_a_table_of_five_megabytes_is_taken_and_a_greater_one_refused(begun):
    visitor, at = begun
    lines = "".join(f"{k},{30 * k}\n" for k in range(40_000))
    table = "frame,time\n" + lines
    assert len(table) > 388_000
    answer = visitor.post("set_table", {"at": at, "name": "times", "table": table})
    assert answer.status_code == 422  # it is read, and has a row for every photograph but is too long
    assert "frame" in answer.text
    assert visitor.post("set_table", {"at": at, "name": "times", "table": "x" * 5_000_001}).status_code == 400
    assert visitor.post("set_table", {"at": at, "name": "times", "table": "x" * 21_000_000}).status_code == 413


@pytest.fixture
def begun(visitor):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    return visitor, at


@pytest.mark.parametrize("at", ["\0", "a\0b", "\ud800", "../..", "x" * 301, "\uffff"])
def test_hostile_names_are_refused_without_a_traceback(root, at):
    visitor = Visitor(Workbench(root)).enter()
    for endpoint in ("project", "run_start", "share", "shared", "stamp"):
        headers = {"Origin": HOST, "Content-Type": "application/json"}
        answer = visitor.client.post(f"/api/{endpoint}", content=json.dumps({"at": at}), headers=headers)
        assert answer.status_code in (400, 422), (endpoint, answer.text)
    for path in ("photograph", "crop", "shared", "events"):
        query = {"at": at.encode(errors="replace").decode(), "x": "nan", "y": "1", "width": "10"}
        assert visitor.client.get(f"/{path}", params=query).status_code in (400, 404, 422), path


def test_values_of_an_edit_that_nothing_can_have_are_refused_or_bounded(begun):
    """Found by hostile requests: each ended in a traceback."""
    visitor, at = begun
    assert visitor.post("delete_rods", {"at": at, "ids": []}).status_code == 400
    found = visitor.post("measure_rod", {"at": at, "x": 50.0, "y": 50.0, "radius": 1e12})
    assert found.status_code == 200


def test_a_name_longer_than_any_file_has_takes_no_folder_with_it(root):
    edit(root / "tracked" / "experiment.toml", 'name = "tracked"', f'name = "{"x" * 300}"')
    shutil.copytree(root / "tracked", root / "other")
    edit(root / "other" / "experiment.toml", "x" * 300, "other")
    assert len(Visitor(Workbench(root)).enter().request("home")["experiments"]) == 2

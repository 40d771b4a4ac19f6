"""One journal of all actions: undone in reverse order, also after a restart, and never over the work of others."""

import pytest
from rodsight.process.errors import InputError
from rodsight.workbench.service.workbench import Workbench
from rodsight.workbench.setup import journal
from rodsight.workbench.setup.draft import Draft
from rodsight.workbench.setup.journal import PLACE, Journal

from tests.app.workbench.conftest import Visitor

BEGIN = {"folder": "my photographs/pictures", "suffix": ".jpg", "name": "mine"}


def interval_of(answer):
    return answer["photographs"].get("interval")


def test_undo_survives_a_restart(visitor, photographs_only):
    at = visitor.request("begin", **BEGIN)["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    again = Visitor(Workbench(photographs_only)).enter()
    assert again.request("project", at=at)["undo"] == "scale"
    answer = again.request("undo", at=at)
    assert (answer["undone"], answer["undo"], answer["redo"]) == ("scale", "photographs", "scale")
    assert interval_of(Visitor(Workbench(photographs_only)).enter().request("undo", at=at)) is None
    answer = visitor.request("redo", at=at)  # the first server sees what the others have done
    assert (interval_of(answer), answer["redo"]) == (30.0, "scale")


def test_an_undo_does_not_overwrite_what_another_program_has_written(visitor, photographs_only):
    at = visitor.request("begin", **BEGIN)["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    file = photographs_only / "my photographs" / "experiment.toml"
    file.write_text(file.read_text() + "# mine\n")
    assert "changed by another program" in visitor.refused("undo", at=at)
    assert file.read_text().endswith("# mine\n")
    visitor.request("set_photographs", at=at, interval=31.0)
    assert interval_of(visitor.request("undo", at=at)) == 30.0


def fail_after_writing(draft):
    draft.write("inner", {"a": b"9", "c": b"9"})
    raise ZeroDivisionError


def test_a_step_of_several_writes_is_one_action_and_an_error_leaves_none(tmp_path):
    draft = Draft(tmp_path, Journal(tmp_path / PLACE))
    with draft.one_step("both"):
        draft.write("inner", {"a": b"1"})
        with draft.one_step("innermost"):
            draft.write("inner", {"a": b"2", "b": b"3"})
    with pytest.raises(ZeroDivisionError), draft.one_step("wrong"):
        fail_after_writing(draft)
    assert (tmp_path / "a").read_bytes() == b"2"
    assert not (tmp_path / "c").exists()
    assert draft.undo() == "both"
    assert not (tmp_path / "a").exists()
    assert draft.undo() is None
    assert draft.redo() == "both"
    assert (tmp_path / "b").read_bytes() == b"3"


def test_a_line_that_a_crash_cut_off_is_skipped(tmp_path):
    draft = Draft(tmp_path, Journal(tmp_path / PLACE))
    draft.write("first", {"a": b"1"})
    with (tmp_path / PLACE / "journal.jsonl").open("a") as stream:
        stream.write('{"do": {"na')
    draft = Draft(tmp_path, Journal(tmp_path / PLACE))
    assert draft.undo() == "first"


def test_an_old_journal_is_shortened_with_its_contents(tmp_path, monkeypatch):
    monkeypatch.setattr(journal, "MOST", 6)
    monkeypatch.setattr(journal, "KEPT", 3)
    draft = Draft(tmp_path, Journal(tmp_path / PLACE))
    for k in range(7):
        draft.write(f"action {k}", {"a": b"%d" % k})
    assert len(list((tmp_path / PLACE / "contents").iterdir())) == 4
    again = Draft(tmp_path, Journal(tmp_path / PLACE))
    assert [again.undo() for _ in range(4)] == ["action 6", "action 5", "action 4", None]
    assert (tmp_path / "a").read_bytes() == b"3"


def test_contents_that_are_gone_are_no_silent_loss(tmp_path):
    draft = Draft(tmp_path, Journal(tmp_path / PLACE))
    draft.write("first", {"a": b"1"})
    draft.write("second", {"a": b"2"})
    for file in (tmp_path / PLACE / "contents").iterdir():
        file.unlink()
    with pytest.raises((OSError, InputError)):
        draft.undo()
    assert (tmp_path / "a").read_bytes() == b"2"


def test_a_new_folder_beside_an_experiment_is_offered_and_named_by_its_path(visitor, photographs_only):
    visitor.request("begin", **BEGIN)
    (pictures,) = [
        each for each in (photographs_only / "my photographs").iterdir() if each.is_dir() and each.name == "pictures"
    ]
    second = photographs_only / "my photographs" / "second test"
    second.mkdir()
    for file in pictures.iterdir():
        (second / file.name).write_bytes(file.read_bytes())
    (series,) = visitor.request("home")["series"]
    assert (series["folder"], series["home"], series["pattern"]) == (
        "my photographs/second test", "my photographs/second test", "*.jpg",
    )  # fmt: skip
    first = photographs_only / "a test before it"  # another window: the list of the first page has changed since
    first.mkdir()
    (first / "a.jpg").write_bytes(next(second.iterdir()).read_bytes())
    described = visitor.request("begin", folder=series["folder"], suffix=series["suffix"], name=series["name"])
    assert described["at"] == "my photographs/second test"
    assert described["files"][0] == "DSC_7.jpg"
    assert "not there any more" in visitor.refused("begin", folder=series["folder"], suffix=".jpg", name="again")

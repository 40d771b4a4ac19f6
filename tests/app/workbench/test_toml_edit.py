"""An edit keeps everything else of experiment.toml, and never replaces what another program has just written."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rodsight.experiment.config.dotted_keys import with_values
from rodsight.process.errors import InputError
from rodsight.workbench.setup.draft import Draft
from rodsight.workbench.setup.toml_edit import set_values

OWN = """# My experiment, 3 May
# second line

name = "mine"   # as in the notebook

[photographs]   # DSC camera
files = "photos/*.jpg"
# every half minute
interval = 30.0 # s

# measured by hand
[walls]
file = "walls.csv"

[walls.top]
pressure = 5e4   # Pa

[material]
density = 2_700
friction = 0.25 # of a tilting table
"""


def test_comments_and_order_stay():
    edited = set_values(OWN, {"photographs.interval": 31.0, "material.friction": 0.3})
    assert edited == OWN.replace("30.0 # s", "31.0 # s").replace("0.25 # of", "0.3 # of")


def test_a_new_key_stands_in_its_table():
    edited = set_values(OWN, {"photographs.pixel_size": 1e-4})
    assert edited == OWN.replace("interval = 30.0 # s\n", "interval = 30.0 # s\npixel_size = 0.0001\n")


def test_a_section_that_is_given_whole_changes_where_it_differs():
    walls = {"file": "walls.csv", "top": {"pressure": 6e4}}
    assert set_values(OWN, {"walls": walls}) == OWN.replace("5e4   # Pa", "60000.0   # Pa")


def test_line_ends_of_another_system_stay():
    other = OWN.replace("\n", "\r\n")
    assert set_values(other, {"photographs.interval": 31.0}) == other.replace("30.0 # s", "31.0 # s")


WAYS = (
    OWN, "", 'name="x"\nphotographs.files="*.jpg"\nwalls = {file = "w.csv", top = {pressure = 1.0}}\n',
    '[walls.top]\npressure = 1.0\n[material]\nfriction = 0.2\n[walls]\nfile = "w.csv"\n',
    '[photographs]\nradii = [\n  0.01, # small\n  0.02,\n]\n',
)  # fmt: skip
KEYS = (
    "name", "photographs.files", "photographs.interval", "photographs.radii", "photographs.lens", "walls", "walls.top",
    "walls.top.pressure", "walls.left", "material.friction", "material.gravity", "solver.sweeps",
)  # fmt: skip
VALUES: tuple[Any, ...] = (None, 1.5, 7, "text", [0.0, -9.81], {"pressure": 2.0, "ends": "free"}, {"k1": 0.1}, {})


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(WAYS), st.lists(st.tuples(st.sampled_from(KEYS), st.sampled_from(VALUES)), max_size=4))
def test_what_is_read_afterwards_is_what_was_set(content, edits):
    keys: dict[str, Any] = {}
    for key, value in edits:
        if not any(key.startswith(f"{each}.") or each.startswith(f"{key}.") for each in keys):
            keys[key] = value
    try:
        wanted = with_values(tomllib.loads(content), keys)
    except (AttributeError, TypeError):  # a key below a value that is no table
        return
    assert tomllib.loads(set_values(content, keys)) == wanted


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    draft = Draft(tmp_path)
    draft.file.write_text(OWN)
    draft.note_shown()
    return draft


def test_what_another_editor_changed_elsewhere_is_kept(draft):
    draft.file.write_text(OWN.replace("0.25 # of a tilting table", "0.31 # measured again"))
    draft.set_keys("interval", {"photographs.interval": 20.0})
    assert draft.file.read_text() == OWN.replace("30.0 # s", "20.0 # s").replace(
        "0.25 # of a tilting table", "0.31 # measured again"
    )


def test_the_same_key_is_not_overwritten_unseen(draft):
    foreign = OWN.replace("friction = 0.25", "friction = 0.31")
    draft.file.write_text(foreign)
    with pytest.raises(InputError, match=r"material\.friction.*from 0\.25 to 0\.31"):
        draft.set_keys("material", {"material.friction": 0.2})
    assert draft.file.read_text() == foreign
    draft.set_keys("material", {"material.friction": 0.2})  # it has been seen
    assert "friction = 0.2 # of" in draft.file.read_text()


def test_the_page_reports_a_change_that_it_has_not_shown(visitor, photographs_only):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    file = photographs_only / "my photographs" / "experiment.toml"
    file.write_text(file.read_text().replace("30.0", "25.0 # from the log"))
    assert "changed by another program" in visitor.refused("set_photographs", at=at, interval=31.0)
    assert "25.0 # from the log" in file.read_text()
    visitor.request("set_scale", at=at, pixel_size=1e-4)
    assert "25.0 # from the log" in file.read_text()

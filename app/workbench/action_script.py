"""The actions of a journal as a Python script, which does them again: on the same photographs, or on others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from .setup.edits import TABLES
from .setup.journal import Action

TRACKED = frozenset(("correct_pose", "mark_lost", "undo_correction"))  # these need tracks
JUDGED = frozenset(("judge", "flag_frame"))  # these need forces
HEAD = '''"""{name}: what was done in the workbench, as a script, which does the same for other photographs."""

from rodsight.workbench.actions import Actions

# The folder that was opened, and the experiment in it; without an experiment there a new one is made.
test = Actions(".", {at!r}, files={files!r}, name={name!r})

'''


def as_script(actions: Sequence[Action], *, at: str, name: str, files: str) -> str:
    """Return a script that repeats actions.

    Parameters
    ----------
    actions : sequence of Action
        In their order; those that were undone are not among them.
    at : str
        The experiment's path from the folder that was opened.
    name : str
        Its name.
    files : str
        Its pattern of photographs.
    """
    return HEAD.format(at=at, name=name, files=files) + "".join(f"{line}\n" for line in _lines(actions))


def _lines(actions: Sequence[Action]) -> Iterator[str]:
    written: str | None = None  # the request of the last line: one may be several actions
    fresh = False  # a run has used everything so far
    for action in actions:
        if action.request is None:
            yield f"# {action.name}: not by the page, or by an earlier version"
            continue
        if action.request["id"] == written:
            continue
        written, endpoint, values = action.request["id"], action.request["endpoint"], action.request["values"]
        if endpoint in TRACKED | JUDGED and not fresh:
            yield "test.run()"
            fresh = True
        fresh = fresh and endpoint in TRACKED | JUDGED
        yield f"test.{endpoint}({_arguments(endpoint, values)})  # {action.name}"
    yield "test.run()"


def _arguments(endpoint: str, values: dict[str, Any]) -> str:
    parts = [f"{key}={value!r}" for key, value in values.items()]
    if endpoint == "set_table" and values.get("name") in TABLES and values.get("given"):
        file = TABLES[values["name"]][1]
        parts = [f"name={values['name']!r}", f"table=test.text({file!r})"]
    return ", ".join(parts)

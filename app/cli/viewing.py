"""What `rodsight view` does with a folder of recordings: a table of them, and all of them in the viewer."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from ..errors import InputError

if TYPE_CHECKING:
    from ..recording.files.catalogue import Entry

# Heading, property, form. A column that no recording has is left out.
COLUMNS = (
    ("name", "experiment:name", ""), ("frames", "experiment:frames", "d"), ("grains", "experiment:grains", "d"),
    ("μ", "experiment:friction", ".3g"), ("load [kPa]", "experiment:pressure_kpa", ".3g"),
    ("contacts", "outcome:contacts_mean", ".0f"), ("φ [°]", "outcome:friction_angle_mean_deg", ".1f"),
    ("settled", "outcome:settled_share", ".0%"), ("suspect", "outcome:suspect_frames", "d"),
    ("least trust", "outcome:trust_least", ".2f"), ("r(f_n)", "outcome:r_fn_mean", ".3f"),
)  # fmt: skip


def view_folder(folder: Path, *, web: bool, only_list: bool, console: Console) -> int:
    """Tell the recordings of a folder by their properties and open them together. Exit status 0.

    The viewer is waited for: the catalogue is served by this process.
    """
    from ..recording.files.catalogue import can_serve, find_recordings, read_entries, serve, show_together
    from ..recording.viewing.viewer import has_display

    files = find_recordings(folder)
    if not files:
        raise InputError(folder, "", "holds no recording: neither recording.rrd nor runs with one")
    entries = read_entries(files)
    list_entries(folder, entries, console)
    files = [entry.file for entry in entries if entry.properties is not None]
    if only_list or not files:
        return 0
    if not web and not has_display():
        console.print(f"No display here. In a browser: rodsight view --web {folder}", highlight=False, soft_wrap=True)
        return 0
    with ExitStack() as stack:
        if can_serve():
            shown = stack.enter_context(serve(files))
        else:
            shown = files
            console.print(
                "Opened side by side. With pip install 'rodsight[catalog]' the viewer shows this table, too.",
                markup=False, highlight=False, soft_wrap=True,
            )  # fmt: skip
        viewer, page = show_together(shown, web=web)
        stack.callback(viewer.terminate)
        if page:
            console.print(f"At {page} until interrupted (Ctrl+C).", markup=False, highlight=False, soft_wrap=True)
        viewer.wait()
    return 0


def list_entries(folder: Path, entries: list[Entry], console: Console) -> None:
    """Print the recordings of a folder with their properties as columns."""
    shown = [column for column in COLUMNS if any(column[1] in (entry.properties or ()) for entry in entries)]
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("recording")
    for heading, _, form in shown:
        table.add_column(heading, justify="right" if form else "left", no_wrap=True)
    for entry in entries:
        cells = [_cell((entry.properties or {}).get(name), form) for _, name, form in shown]
        table.add_row(str(entry.file.relative_to(folder)), *cells)
    console.print(table)
    for entry in entries:
        if entry.properties is None:
            console.print(
                f"{entry.file} is damaged. What can be saved: rodsight share --repair {entry.file}",
                markup=False, highlight=False, soft_wrap=True,
            )  # fmt: skip


def _cell(value: str | int | float | None, form: str) -> str:
    return "–" if value is None else format(value, form)

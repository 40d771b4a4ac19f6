"""Commands that look at results: view, review, score, compare."""

from __future__ import annotations

import json
import sys
import threading
import webbrowser
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.console import Console
from rich.table import Table

from ...errors import InputError
from ..terminal import table_console, tell

if TYPE_CHECKING:
    from ...recording.files.catalogue import CatalogueRow
    from ...results.comparison import Comparison
    from ...results.hdf5.store import Provenance
    from ...results.results import Results

# Heading, property, form. A column that no recording has is left out.
COLUMNS = (
    ("name", "experiment:name", ""), ("frames", "experiment:frames", "d"), ("grains", "experiment:grains", "d"),
    ("μ", "experiment:friction", ".3g"), ("load [kPa]", "experiment:pressure_kpa", ".3g"),
    ("contacts", "outcome:contacts_mean", ".0f"), ("φ [°]", "outcome:friction_angle_mean_deg", ".1f"),
    ("settled", "outcome:settled_share", ".0%"), ("suspect", "outcome:suspect_frames", "d"),
    ("least trust", "outcome:trust_least", ".2f"), ("r(f_n)", "outcome:r_fn_mean", ".3f"),
)  # fmt: skip


def view(
    recording: Annotated[
        Path,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="RECORDING_OR_DIR", help="a recording, a run's folder, or a folder of runs"),
    ],
    /,
    web: Annotated[
        bool,
        tyro.conf.FlagCreatePairsOff,
        tyro.conf.arg(help="in a browser: tells the address, and serves it until Ctrl+C"),
    ] = False,
    only_list: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(name="list", help="of a folder: tell what is in it, no more")
    ] = False,
) -> int:
    """Open a recording with its blueprint, or a folder of recordings as a catalogue.

    Example: rodsight view runs/shear --web
    """
    from ...recording.parts import parts_of
    from ...run_folder import RECORDING, SIDE

    if recording.is_dir() and (only_list or not (recording / RECORDING).is_file()):
        return _view_folder(recording, web=web, only_list=only_list, console=table_console())
    file = recording / RECORDING if recording.is_dir() else recording
    if not file.is_file():
        raise InputError(file, "", "there is no such recording")
    side = file.with_name(SIDE)
    also = (side,) if recording.is_dir() and side.is_file() else ()
    if web:
        return _serve([*parts_of(file), *also], Console())
    return show(file, "native", Console(), *also)


def review(
    experiment: Annotated[
        Path, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT_OR_DIR", help="an experiment, or a run's folder")
    ],
    /,
    port: Annotated[int, tyro.conf.arg(help="of the page on 127.0.0.1; 0 takes a free one")] = 0,
    browser: Annotated[bool, tyro.conf.arg(help="open the page")] = True,
    reviewer: Annotated[str | None, tyro.conf.arg(metavar="NAME", help="who judges; default: the user's name")] = None,
    import_csv: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="add verdicts of a table frame,i,j[,verdict], and end")
    ] = None,
    complete: Annotated[
        bool,
        tyro.conf.FlagCreatePairsOff,
        tyro.conf.arg(help="the imported table lists every contact of its frames: all other candidates are none"),
    ] = False,
    export_csv: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="write the verdicts as a table, and end")
    ] = None,
) -> int:
    """Judge contacts by eye on a local page; the solver obeys.

    Example: rodsight review runs/shear
    """
    from ...review import command

    if import_csv is not None:
        return command.import_table(experiment, import_csv, reviewer=reviewer, complete=complete)
    if export_csv is not None:
        return command.export_table(experiment, export_csv)
    return command.review(experiment, port=port, browser=browser, reviewer=reviewer)


def score(
    results: Annotated[
        Path, tyro.conf.Positional, tyro.conf.arg(metavar="RESULTS", help="a run's folder, or results.h5")
    ],
    /,
    truth: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="table frame,i,j,fn,ft; default: the experiment's")
    ] = None,
    as_json: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(name="json", help="print JSON")] = False,
    fit_threshold: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="refit gap threshold and radii from verdicts")
    ] = False,
) -> int:
    """Compare inferred contacts and forces with true ones, and with the verdicts of people.

    Example: rodsight score runs/shear --json
    """
    import numpy as np

    from ...experiment.experiment import load_experiment
    from ...results.hdf5.store import load_results, origin_of
    from ...results.summary import summarize
    from ...results.truth import accuracy, correlations
    from ...results.truth import score as score_frames
    from ...review.judging import scoring
    from ...review.reviewed_run import Reviewed
    from ...run_folder import RESULTS, Run, find_experiment
    from ...run_truth import load_truth
    from ...study.baselines import baseline_lists, score_baselines, tell_baselines
    from ..summary_table import print_summary

    file = results / RESULTS if results.is_dir() else results
    solved, origin = load_results(file), origin_of(file)
    run = Run(load_experiment(find_experiment(file, origin)), file.parent, origin.frames)
    known = load_truth(run, solved, truth)
    reviewed = Reviewed(file, solved, run.experiment, origin.frames[0])
    verdicts = scoring.score_verdicts(reviewed)
    if known is None and verdicts is None:
        raise InputError(
            run.experiment.file, "key truth", "is missing: give --truth FILE, or verdicts (rodsight review)"
        )
    if fit_threshold and verdicts is None:
        raise InputError(reviewed.log.file, "", "holds no verdicts to fit a threshold to: rodsight review")
    fitted = scoring.fit(reviewed, verdicts) if fit_threshold and verdicts is not None else None
    agreement = score_frames(solved, known) if known is not None else []
    if as_json:
        told: dict[str, Any] = {}
        if known is not None:
            told = accuracy(agreement) | {"baselines": baseline_lists(score_baselines(solved, known))}
        if verdicts is not None:
            told["verdicts"] = scoring.as_json(verdicts, fitted)
        print(json.dumps(told, indent=1))
        return 0
    console = Console()
    if verdicts is not None:
        scoring.print_score(console, verdicts, fitted)
    if known is None:
        return 0
    print_summary(console, summarize(solved, agreement, {}))
    r = np.array(correlations(agreement))
    console.print(f"r(f_n) over all frames: mean {np.nanmean(r):.3f}, least {np.nanmin(r):.3f}.", highlight=False)
    console.print(tell_baselines(score_baselines(solved, known)), highlight=False, soft_wrap=True)
    return 0


def compare(
    first: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="A", help="folder of a run, or results.h5")],
    second: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="B", help="the other run")] = None,
    /,
    truth: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="compare A with its truth")] = False,
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help="the recording; default compare-A-B.rrd")] = None,
) -> int:
    """Show two results side by side with their difference.

    Example: rodsight compare runs/shear runs/stiffer --out compare.rrd
    """
    from ...recording.comparison_layer import record_comparison
    from ...results.comparison import DifferentPackingError, compare_runs

    if (second is None) != truth:
        raise InputError("compare", "", "give two results, or one and --truth")
    a, origin = _load(first)
    names = _names(first, second)
    if second is None:
        comparison = _compare_with_truth(a, origin, first, names[0])
    else:
        b, other = _load(second)
        try:
            comparison = compare_runs(a, b, names=names, starts=(origin.frames[0], other.frames[0]))
        except DifferentPackingError as error:
            raise InputError(second, "", str(error)) from None
    target = out if out is not None else Path(f"compare-{names[0]}-{names[1]}.rrd")
    size = record_comparison(comparison, target)
    console = Console(soft_wrap=True)
    _tell_comparison(comparison, console)
    tell(console, f"{target}: {1e-6 * size:.1f} MB. To look at it: rodsight view {target}")
    return 0


def show(recording: Path, how: str, console: Console, *also: Path) -> int:
    """Open a recording, or say how to. Exit status 0."""
    from ...recording.parts import parts_of
    from ...recording.viewing.viewer import open_viewer

    hint = open_viewer(recording, how, *parts_of(recording)[1:], *also)
    if hint is not None:
        console.print(hint, highlight=False, soft_wrap=True)
    return 0


def _serve(files: list[Path], console: Console) -> int:
    """Serve recordings to a browser of this machine, on a port of their own, until interrupted. Exit status 0."""
    from ...recording.viewing.recording_server import RecordingServer
    from ...recording.viewing.viewer import has_display

    server = RecordingServer(files)
    tell(console, f"At {server.address} until interrupted (Ctrl+C).")
    sys.stdout.flush()  # whoever reads it through a pipe waits for it
    if has_display():
        webbrowser.open(server.address)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:  # how it is meant to end
        return 0
    return 0


def _view_folder(folder: Path, *, web: bool, only_list: bool, console: Console) -> int:
    """Tell the recordings of a folder by their properties and open them together. Exit status 0.

    The viewer is waited for: the catalogue is served by this process.
    """
    from ...recording.files.catalogue import can_serve, find_recordings, read_entries, serve, show_together
    from ...recording.viewing.viewer import has_display

    files = find_recordings(folder)
    if not files:
        raise InputError(folder, "", "holds no recording: neither recording.rrd nor runs with one")
    entries = read_entries(files)
    _list_entries(folder, entries, console)
    files = [entry.file for entry in entries if entry.properties is not None]
    if only_list or not files:
        return 0
    if not web and not has_display():
        console.print(f"No display here. In a browser: rodsight view --web {folder}", highlight=False, soft_wrap=True)
        return 0
    if web:
        return _serve(files, console)
    with ExitStack() as stack:
        if can_serve():
            shown = stack.enter_context(serve(files))
        else:
            shown = files
            tell(console, "Opened side by side. With pip install 'rodsight[catalog]' the viewer shows this table, too.")
        viewer = show_together(shown)
        stack.callback(viewer.terminate)
        viewer.wait()
    return 0


def _list_entries(folder: Path, entries: list[CatalogueRow], console: Console) -> None:
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
            tell(console, f"{entry.file} is damaged. What can be saved: rodsight share --repair {entry.file}")


def _cell(value: str | int | float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _compare_with_truth(results: Results, origin: Provenance, path: Path, name: str) -> Comparison:
    from ...experiment.experiment import load_experiment
    from ...results.comparison import compare_with_truth
    from ...run_folder import RESULTS, Run, find_experiment
    from ...run_truth import load_truth

    file = path / RESULTS if path.is_dir() else path
    run = Run(load_experiment(find_experiment(file, origin)), file.parent, origin.frames)
    truth = load_truth(run, results)
    if truth is None:
        raise InputError(run.experiment.file, "key truth", "is missing: there is nothing to compare with")
    return compare_with_truth(results, truth, name=name)


def _load(path: Path) -> tuple[Results, Provenance]:
    from ...results.hdf5.store import load_results, origin_of
    from ...run_folder import RESULTS

    file = path / RESULTS if path.is_dir() else path
    return load_results(file), origin_of(file)


def _names(first: Path, second: Path | None) -> tuple[str, str]:
    """Names of the two sides: their folders, told apart where they are called the same."""
    names = [(path.parent if path.is_file() else path).resolve().name or "run" for path in (first, second) if path]
    if len(names) == 1:
        return names[0], "truth"
    return (names[0], names[1]) if names[0] != names[1] else (f"{names[0]} (1)", f"{names[1]} (2)")


def _tell_comparison(comparison: Comparison, console: Console) -> None:
    import numpy as np

    first, second = comparison.first, comparison.second
    r = np.array([[each.r_fn, each.r_ft, each.relative_l2, each.scale] for each in comparison.agreement])
    angle = np.degrees([[x.friction_angle, y.friction_angle] for x, y in zip(first.frames, second.frames, strict=True)])
    mean = [float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in r.T]
    least = float(np.nanmin(r[:, 0])) if np.isfinite(r[:, 0]).any() else float("nan")
    apart = float(np.sqrt(np.nanmean(np.diff(angle, axis=1) ** 2)))
    tell(
        console,
        f"{first.name} against {second.name}, {len(r)} frames: r(f_n) mean {mean[0]:.3f}, least {least:.3f}; r(f_t) "
        f"mean {mean[1]:.3f}; relative L2 {mean[2]:.3f}; ratio of the sums of f_n {mean[3]:.3f}; friction angles "
        f"apart by {apart:.2f}° rms.",
    )
    for note in comparison.notes:
        tell(console, note)

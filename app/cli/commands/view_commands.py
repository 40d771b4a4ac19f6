"""Commands that show and judge results: view, review, score, compare."""

from __future__ import annotations

import json
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import Console
from rich.table import Table
from tyro.conf import Positional, arg

from ...process.counts import state_count
from ...process.errors import InputError
from ...process.machine.browser import open_page
from ..arguments import AsJson, Browser, Flag, Port, ResultsPath, refuse_unused
from ..stored_results import has_experiment, load_run, recording_file, results_file, warn_out_of_date
from ..terminal import print_line, table_console

if TYPE_CHECKING:
    from ...recording.archive.catalogue import CatalogueRow
    from ...results.comparison import Comparison
    from ...results.hdf5.store import Provenance
    from ...results.results import Results, TruthContacts

# Heading, property, format. A column without values is left out.
COLUMNS = (
    ("name", "experiment:name", ""), ("frames", "experiment:frames", "d"), ("grains", "experiment:grains", "d"),
    ("μ", "experiment:friction", ".3g"), ("load [kPa]", "experiment:pressure_kpa", ".3g"),
    ("contacts", "outcome:contacts_mean", ".0f"), ("φ [°]", "outcome:friction_angle_mean_deg", ".1f"),
    ("settled", "outcome:settled_share", ".0%"), ("suspect", "outcome:suspect_frames", "d"),
    ("least trust", "outcome:trust_least", ".2f"), ("r(f_n)", "outcome:r_fn_mean", ".3f"),
)  # fmt: skip


def view(
    recording: Annotated[
        Path, Positional, arg(metavar="RECORDING_OR_DIR", help="a recording, a run's folder, or a folder of runs")
    ],
    /,
    web: Annotated[Flag, arg(help="in a browser: prints the address, and serves it until Ctrl+C")] = False,
    only_list: Annotated[Flag, arg(name="list", help="of a folder: list its recordings only")] = False,
) -> int:
    """Open a recording with its blueprint, or a folder of recordings as a catalogue.

    Example: rodsight view runs/shear --web
    """
    from ...recording.parts import parts_of
    from ...run_folder import SIDE

    file = recording_file(recording)
    if recording.is_dir() and (only_list or not file.is_file()):
        return _view_folder(recording, web=web, only_list=only_list, console=table_console())
    if not file.is_file():
        raise InputError(file, "", "there is no such recording")
    warn_out_of_date(file, Console())
    side = file.with_name(SIDE)
    also = (side,) if recording.is_dir() and side.is_file() else ()
    if web:
        return _serve([*parts_of(file), *also], Console())
    return show(file, "native", Console(), *also)


def review(
    experiment: Annotated[Path, Positional, arg(metavar="EXPERIMENT_OR_DIR", help="an experiment, or a run's folder")],
    /,
    port: Port = 0,
    browser: Browser = True,
    reviewer: Annotated[str | None, arg(metavar="NAME", help="who judges; default: the user's name")] = None,
    import_csv: Annotated[
        Path | None, arg(metavar="FILE", help="add the verdicts of a table frame,i,j[,verdict], and end")
    ] = None,
    complete: Annotated[
        Flag, arg(help="the imported table lists every contact of its frames: all other candidates are none")
    ] = False,
    export_csv: Annotated[Path | None, arg(metavar="FILE", help="write the verdicts as a table, and end")] = None,
) -> int:
    """Judge contacts by eye on a local page; the solver uses the verdicts.

    Example: rodsight review runs/shear
    """
    from ...reviewing import verdict_tables

    if import_csv is None:
        refuse_unused("review", {"--complete": complete}, "without --import-csv")
    elif export_csv is not None:
        raise InputError("review", "--export-csv", "does not apply with --import-csv: give them one after the other")
    if import_csv is not None:
        return verdict_tables.import_table(experiment, import_csv, reviewer=reviewer, complete=complete)
    if export_csv is not None:
        return verdict_tables.export_table(experiment, export_csv)
    from ...workbench.command import open_review

    return open_review(experiment, port=port, browser=browser, reviewer=reviewer)


def score(
    results: ResultsPath,
    /,
    truth: Annotated[Path | None, arg(metavar="FILE", help="table frame,i,j,fn,ft; default: the experiment's")] = None,
    as_json: AsJson = False,
    fit_threshold: Annotated[Flag, arg(help="refit gap threshold and radii from verdicts")] = False,
) -> int:
    """Compare inferred contacts and forces with true ones, and with the verdicts of people.

    Example: rodsight score runs/shear --json
    """
    from ...results.truth import accuracy
    from ...results.truth import score as score_frames
    from ...reviewing.judging import scoring
    from ...reviewing.reviewed_run import ReviewedRun
    from ...run_truth import load_truth
    from ...study.baselines import baseline_lists, score_baselines

    warn_out_of_date(results)
    if truth is not None and not has_experiment(results):
        return _score_alone(results_file(results), truth, as_json=as_json, fit_threshold=fit_threshold)
    run, solved = load_run(results)
    known = load_truth(run, solved, truth)
    reviewed = ReviewedRun(results_file(results), solved, run.experiment, run.frames.start)
    verdicts = scoring.score_verdicts(reviewed)
    if known is None and verdicts is None:
        raise InputError(
            run.experiment.file, "key truth", "is missing: give --truth FILE, or verdicts (rodsight review)"
        )
    if fit_threshold and verdicts is None:
        raise InputError(reviewed.log.file, "", "holds no verdicts to fit a threshold to: rodsight review")
    fitted = scoring.fit_to_verdicts(reviewed, verdicts) if fit_threshold and verdicts is not None else None
    agreement = score_frames(solved, known) if known is not None else []
    if as_json:
        values: dict[str, Any] = {}
        if known is not None:
            values = accuracy(agreement) | {"baselines": baseline_lists(score_baselines(solved, known))}
        if verdicts is not None:
            values["verdicts"] = scoring.as_json(verdicts, fitted)
        print(json.dumps(values, indent=1))
        return 0
    console = Console()
    if verdicts is not None:
        scoring.print_score(console, verdicts, fitted)
    if known is not None:
        _print_agreement(console, solved, known)
    return 0


def _score_alone(file: Path, truth: Path, *, as_json: bool, fit_threshold: bool) -> int:
    """Score results whose experiment is not at hand. Exit status 0."""
    from ...results.hdf5.store import load_results
    from ...results.truth import accuracy
    from ...results.truth import score as score_frames
    from ...run_truth import truth_beside
    from ...study.baselines import baseline_lists, score_baselines

    if fit_threshold:
        raise InputError(file, "--fit-threshold", "needs the experiment of these results, which is missing")
    solved = load_results(file)
    known = truth_beside(file, solved, truth)
    if as_json:
        values = accuracy(score_frames(solved, known)) | {"baselines": baseline_lists(score_baselines(solved, known))}
        print(json.dumps(values, indent=1))
    else:
        _print_agreement(Console(), solved, known)
    return 0


def _print_agreement(console: Console, solved: Results, known: TruthContacts) -> None:
    import numpy as np

    from ...results.summary import summarize
    from ...results.truth import correlations
    from ...results.truth import score as score_frames
    from ...study.baselines import describe_baselines, score_baselines
    from ..summary_table import print_summary

    agreement = score_frames(solved, known)
    print_summary(console, summarize(solved, agreement, {}))
    r = np.array(correlations(agreement))
    console.print(f"r(f_n) over all frames: mean {np.nanmean(r):.3f}, least {np.nanmin(r):.3f}.", highlight=False)
    console.print(describe_baselines(score_baselines(solved, known)), highlight=False, soft_wrap=True)


def compare(
    first: Annotated[Path, Positional, arg(metavar="A", help="folder of a run, or results.h5")],
    second: Annotated[Path | None, Positional, arg(metavar="B", help="the other run")] = None,
    /,
    truth: Annotated[Flag, arg(help="compare A with its truth")] = False,
    out: Annotated[Path | None, arg(metavar="FILE", help="the recording; default compare-A-B.rrd")] = None,
) -> int:
    """Show two results side by side with their difference.

    Example: rodsight compare runs/shear runs/stiffer --out compare.rrd
    """
    from ...recording.comparison_layer import record_comparison
    from ...results.comparison import DifferentPackingError, compare_runs

    if (second is None) != truth:
        raise InputError("compare", "", "give two results, or one and --truth")
    names = _names(first, second)
    for path in (first,) if second is None else (first, second):
        warn_out_of_date(path)
    if second is None:
        comparison = _compare_with_truth(first, names[0])
    else:
        a, origin = _load(first)
        b, other = _load(second)
        steps = origin.frames.step, other.frames.step
        starts = origin.frames.start, other.frames.start
        if steps[0] != steps[1] or (starts[1] - starts[0]) % steps[0]:
            raise InputError(second, f"frames {other.frames}", f"are not those of {names[0]}, {origin.frames}")
        try:
            comparison = compare_runs(a, b, names=names, starts=(0, (starts[1] - starts[0]) // steps[0]))
        except DifferentPackingError as error:
            raise InputError(second, "", str(error)) from None
    target = out if out is not None else Path(f"compare-{names[0]}-{names[1]}.rrd")
    size = record_comparison(comparison, target)
    console = Console(soft_wrap=True)
    _print_comparison(comparison, console)
    print_line(console, f"{target}: {1e-6 * size:.1f} MB. To view it: rodsight view {target}")
    return 0


def show(recording: Path, how: str, console: Console, *also: Path) -> int:
    """Open a recording, or print how to open it. Exit status 0."""
    from ...recording.parts import parts_of
    from ...recording.viewing.open_viewer import open_viewer

    hint = open_viewer(recording, how, *parts_of(recording)[1:], *also)
    if hint is not None:
        console.print(hint, highlight=False, soft_wrap=True)
    return 0


def _serve(files: list[Path], console: Console) -> int:
    """Serve recordings to a browser of this machine, on a port of their own, until interrupted. Exit status 0."""
    from ...recording.viewing.recording_server import RecordingServer
    from ...recording.viewing.viewer import has_display

    server = RecordingServer(files)
    try:  # from the first moment at which a reader knows the address
        print_line(console, f"At {server.address} until interrupted (Ctrl+C).")
        sys.stdout.flush()  # a reader of a pipe waits for the address
        if has_display():
            open_page(server.address)
        threading.Event().wait()
    except KeyboardInterrupt:  # the normal end
        return 0
    return 0


def _view_folder(folder: Path, *, web: bool, only_list: bool, console: Console) -> int:
    """List the recordings of a folder by their properties and open them together. Exit status 0."""
    from ...recording.archive.catalogue import find_recordings, read_catalogue
    from ...recording.viewing.viewer import has_display, start_viewer

    files = find_recordings(folder)
    if not files:
        raise InputError(folder, "", "holds no recording: neither recording.rrd nor runs with one")
    entries = read_catalogue(files)
    _list_entries(folder, entries, console)
    files = [entry.file for entry in entries if entry.properties is not None]
    if only_list or not files:
        return 0
    if not web and not has_display():
        console.print(f"No display here. In a browser: rodsight view --web {folder}", highlight=False, soft_wrap=True)
        return 0
    if web:
        return _serve(files, console)
    viewer = start_viewer("--hide-welcome-screen", *files)
    try:
        viewer.wait()
    finally:
        viewer.terminate()
    return 0


def _list_entries(folder: Path, entries: list[CatalogueRow], console: Console) -> None:
    """Print the recordings of a folder with their properties as columns."""
    from ...out_of_date import state_of_source

    states = ["; ".join(state_of_source(entry.file)) for entry in entries]
    shown = [column for column in COLUMNS if any(column[1] in (entry.properties or ()) for entry in entries)]
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("recording")
    for heading, _, form in shown:
        table.add_column(heading, justify="right" if form else "left", no_wrap=True)
    if any(states):
        table.add_column("out of date")
    for entry, state in zip(entries, states, strict=True):
        cells = [_cell((entry.properties or {}).get(name), form) for _, name, form in shown]
        table.add_row(str(entry.file.relative_to(folder)), *cells, *([state] if any(states) else []))
    console.print(table)
    for entry in entries:
        if entry.properties is None:
            print_line(
                console, f"{entry.file} is damaged. Recover what is readable: rodsight share --repair {entry.file}"
            )


def _cell(value: str | int | float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _compare_with_truth(path: Path, name: str) -> Comparison:
    from ...results.comparison import compare_with_truth
    from ...run_truth import load_truth

    run, results = load_run(path)
    truth = load_truth(run, results)
    if truth is None:
        raise InputError(run.experiment.file, "key truth", "is missing: there is nothing to compare with")
    return compare_with_truth(results, truth, name=name)


def _load(path: Path) -> tuple[Results, Provenance]:
    from ...results.hdf5.store import load_results, origin_of

    file = results_file(path)
    return load_results(file), origin_of(file)


def _names(first: Path, second: Path | None) -> tuple[str, str]:
    """Return the names of the two sides: those of their folders, numbered if equal."""
    names = [(path.parent if path.is_file() else path).resolve().name or "run" for path in (first, second) if path]
    if len(names) == 1:
        return names[0], "truth"
    return (names[0], names[1]) if names[0] != names[1] else (f"{names[0]} (1)", f"{names[1]} (2)")


def _print_comparison(comparison: Comparison, console: Console) -> None:
    import numpy as np

    first, second = comparison.first, comparison.second
    r = np.array([[each.r_fn, each.r_ft, each.relative_l2, each.scale] for each in comparison.agreement])
    angle = np.degrees([[x.friction_angle, y.friction_angle] for x, y in zip(first.frames, second.frames, strict=True)])
    mean = [float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in r.T]
    least = float(np.nanmin(r[:, 0])) if np.isfinite(r[:, 0]).any() else float("nan")
    difference = float(np.sqrt(np.nanmean(np.diff(angle, axis=1) ** 2)))
    print_line(
        console,
        f"{first.name} against {second.name}, {state_count(len(r), 'frame')}: r(f_n) mean {mean[0]:.3f}, least "
        f"{least:.3f}; r(f_t) mean {mean[1]:.3f}; "
        f"relative L2 {mean[2]:.3f}; ratio of the sums of f_n {mean[3]:.3f}; friction angles "
        f"differ by {difference:.2f}° rms.",
    )
    for note in comparison.notes:
        print_line(console, note)

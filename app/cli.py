"""The `rodsight` command: arguments in, a stage called, an exit status out. No logic lives here.

Exit status: 0 done, 1 failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from app import __version__
from app.errors import InputError

ExperimentPath = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT")]
Out = Annotated[Path | None, tyro.conf.arg(metavar="DIR", help="folder of the results; default runs/<name>")]
Settings = Annotated[
    tuple[str, ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(name="set", metavar="KEY=VALUE", help="lay a setting over experiment.toml, e.g. solver.kappa=0.1"),
]
Frames = Annotated[str | None, tyro.conf.arg(metavar="A:B", help="only the frames A … B − 1")]
Quiet = Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="show no progress and no table")]
Sweeps = Annotated[
    Literal["all", "log", "none"] | None, tyro.conf.arg(help="whose forces the recording holds; default log")
]

MaxSize = Annotated[
    float | None, tyro.conf.arg(metavar="MB", help="of the recording: fewer sweeps where it would be larger")
]
FullFrames = Annotated[
    tuple[int, ...],
    tyro.conf.arg(
        metavar="FRAME", help="with --sweeps all: every sweep of these frames to a side file, others thinned"
    ),
]


def run(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    view: Literal["none", "native", "web"] = "none",
    sweeps: Sweeps = None,
    max_size: MaxSize = None,
    full_frames: FullFrames = (),
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Photographs to contact forces and a recording: the main job.

    Example: rodsight run sample_data/shear --view web
    """
    from app import commands

    return commands.run_all(_request(experiment, out, frames, settings, sweeps, quiet, max_size, full_frames), view)


def check(experiment: ExperimentPath, /, settings: Settings = (), quiet: Quiet = False) -> int:
    """Validate an experiment without computing.

    Example: rodsight check sample_data/shear
    """
    from app import commands

    return commands.check(_request(experiment, None, None, settings, None, quiet))


def track(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    frames: Frames = None,
    report: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="write DIR/tracking_report.html: how well it went")
    ] = False,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Follow the grains through the photographs, no more.

    Example: rodsight track sample_data/shear --report
    """
    from app import commands

    return commands.track(_request(experiment, out, frames, settings, None, quiet), report=report)


def solve(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    sweeps: Sweeps = None,
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Find contacts and forces, tracking first where that has not been done.

    Example: rodsight solve sample_data/shear --set contacts.threshold_sigmas=5
    """
    from app import commands

    return commands.solve(_request(experiment, out, frames, settings, sweeps, quiet))


def record(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    sweeps: Sweeps = None,
    max_size: MaxSize = None,
    full_frames: FullFrames = (),
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Write the recording, solving first where that has not been done.

    Example: rodsight record sample_data/shear --sweeps all
    """
    from app import commands

    return commands.record(_request(experiment, out, frames, settings, sweeps, quiet, max_size, full_frames))


def view(
    recording: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RECORDING_OR_DIR")],
    /,
    web: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="in a browser")] = False,
) -> int:
    """Open a recording with its blueprint.

    Example: rodsight view runs/shear --web
    """
    from app import commands

    return commands.view(recording, web=web)


def score(
    results: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RESULTS")],
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
    from app import commands

    return commands.score(results, truth, as_json=as_json, fit_threshold=fit_threshold)


def review(
    experiment: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT_OR_DIR")],
    /,
    port: Annotated[int, tyro.conf.arg(help="on 127.0.0.1; 0 takes a free one")] = 0,
    browser: Annotated[bool, tyro.conf.arg(help="open the page")] = True,
    reviewer: Annotated[str | None, tyro.conf.arg(metavar="NAME", help="default: the user's name")] = None,
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
    from app import commands

    return commands.review(
        experiment, port=port, browser=browser, reviewer=reviewer, import_csv=import_csv, complete=complete,
        export_csv=export_csv,
    )  # fmt: skip


def synth(
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT", help="folder to make")],
    /,
    preset: Literal["small", "paper"] = "small",
    seed: int = 0,
    photographs: Annotated[bool, tyro.conf.arg(help="render photographs; otherwise write tracks")] = True,
    noise: Annotated[float, tyro.conf.arg(help="of a tracked position [m], with --no-photographs")] = 0.0,
    depth: Annotated[Literal[8, 16], tyro.conf.arg(help="bits of a photograph")] = 8,
    jpeg_quality: Annotated[int | None, tyro.conf.arg(help="of 8-bit photographs; default: the preset's")] = None,
    png: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="write PNG, not JPEG")] = False,
    grains: Annotated[int | None, tyro.conf.arg(help="number of rods")] = None,
    frame_count: Annotated[int | None, tyro.conf.arg(name="frames", help="number of photographs")] = None,
    step_degrees: Annotated[float | None, tyro.conf.arg(help="shear between photographs")] = None,
    pixel_size: Annotated[float | None, tyro.conf.arg(help="[m]")] = None,
    reversal: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="turn back half way")] = False,
    quiet: Quiet = False,
) -> int:
    """Make a synthetic experiment with its truth: explicit DEM, walls, speckle photographs.

    Example: rodsight synth my_test --preset small --seed 3
    """
    from app import commands

    return commands.synth(
        out, quiet=quiet, preset=preset, seed=seed, photographs=photographs, noise=noise, depth=depth,
        jpeg_quality=jpeg_quality, png=png, grains=grains, frames=frame_count, step_degrees=step_degrees,
        pixel_size=pixel_size, reversal=reversal,
    )  # fmt: skip


def study(
    subject: Annotated[
        Literal["paper", "accuracy", "status"],
        tyro.conf.Positional,
        tyro.conf.arg(help="the paper's claims; r against noise; trust, status and error bars refitted"),
    ],
    /,
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="of the simulated packings")] = (0, 1, 2),
    grains: Annotated[int, tyro.conf.arg(help="rods of a packing")] = 1172,
    estimator: Literal["ensemble", "nlgs"] = "ensemble",
    out: Annotated[Path, tyro.conf.arg(metavar="DIR", help="where simulated truths are kept")] = Path("runs/study"),
    quiet: Quiet = False,
) -> int:
    """Measure the method on simulated truth: minutes for each packing, kept for the next time.

    Example: rodsight study paper --seeds 0 1 --grains 400
    """
    from app import commands

    return commands.study(subject, seeds=seeds, grains=grains, estimator=estimator, folder=out, quiet=quiet)


def share(
    source: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="RECORDING_OR_DIR")] = None,
    /,
    frames: Frames = None,
    scale: Annotated[float, tyro.conf.arg(help="of photographs, 0.5: half as wide and high")] = 1.0,
    html: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="one page with the viewer in it")] = False,
    repair: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help="mend a damaged recording instead")] = None,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="what to write; default: beside the recording")
    ] = None,
) -> int:
    """Make a small recording to send, or one HTML file that any browser opens.

    Example: rodsight share runs/shear --frames 0:12 --scale 0.5 --html
    """
    from app import sharing

    return sharing.share(
        source, frames=frames, scale=scale, page=html, damaged=repair, out=out, console=Console(soft_wrap=True)
    )


def compare(
    first: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="A", help="folder of a run, or results.h5")],
    second: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="B")] = None,
    /,
    truth: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="compare A with its truth")] = False,
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help="the recording; default compare-A-B.rrd")] = None,
) -> int:
    """Show two results side by side with their difference.

    Example: rodsight compare runs/shear runs/shear-nlgs --out compare.rrd
    """
    from app import comparing

    return comparing.compare(first, second, truth=truth, out=out, console=Console(soft_wrap=True))


def export(
    what: Annotated[Literal["pictures", "video", "tables", "vtk", "dic"], tyro.conf.Positional],
    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RESULTS", help="a run's folder or file")],
    /,
    out: Annotated[Path | None, tyro.conf.arg(metavar="PATH", help="default: beside the results")] = None,
    kind: Annotated[Literal["csv", "parquet"], tyro.conf.arg(help="of tables")] = "csv",
    frames: Annotated[str | None, tyro.conf.arg(metavar="A:B", help="pictures, video: of the timeline")] = None,
    timeline: Annotated[Literal["frame", "sweep"], tyro.conf.arg(help="pictures, video")] = "frame",
    step: Annotated[int, tyro.conf.arg(help="pictures, video: every so many values")] = 1,
    tab: Annotated[str | None, tyro.conf.arg(help="pictures, video: the tab to show")] = None,
    view: Annotated[str | None, tyro.conf.arg(help="pictures, video: one view alone, by its title")] = None,
    size: Annotated[str, tyro.conf.arg(metavar="WxH", help="pictures, video: of the window")] = "1600x1000",
    rate: Annotated[float, tyro.conf.arg(help="video: pictures a second")] = 6.0,
    pixel_size: Annotated[float | None, tyro.conf.arg(help="dic: [m]; default: the experiment's")] = None,
    quiet: Quiet = False,
) -> int:
    """Write pictures, a video, tidy tables, VTK files or tracker files.

    Example: rodsight export video runs/shear --view "Force network"
    """
    from app import exporting
    from app.commands import progress_of

    with progress_of(quiet) as progress:
        return exporting.export(
            what, source, out, console=Console(quiet=quiet), progress=progress, kind=kind, timeline=timeline,
            times=frames, step=step, tab=tab, view=view, size=size, rate=rate, pixel_size=pixel_size,
        )  # fmt: skip


def import_(
    form: Annotated[Literal["dic"], tyro.conf.Positional],
    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER", help="of dic_out_N.txt or CONFNNNN")],
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT", help="folder to make")],
    /,
    pixel_size: Annotated[float, tyro.conf.arg(help="[m]")],
    interval: Annotated[float, tyro.conf.arg(help="[s] between photographs")] = 1.0,
    height: Annotated[int | None, tyro.conf.arg(help="of a photograph [px]; default: what holds all grains")] = None,
    precision: Annotated[float, tyro.conf.arg(help="of a tracked position [px]")] = 0.05,
    quiet: Quiet = False,
) -> int:
    """Make an experiment of another tracker's files.

    Example: rodsight import dic tracked/ my_test --pixel-size 1.2e-4
    """
    from app import importing

    return importing.import_dic(
        source, out, pixel_size=pixel_size, interval=interval, height=height, precision=precision,
        console=Console(quiet=quiet),
    )  # fmt: skip


COMMANDS: tuple[Callable[..., int], ...] = (
    run,
    check,
    track,
    solve,
    record,
    view,
    review,
    score,
    synth,
    study,
    share,
    compare,
    export,
    import_,
)


def main(arguments: list[str] | None = None) -> None:
    """Parse the arguments, run one command, exit."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments == ["--version"]:
        print(f"rodsight {__version__}")
        sys.exit(0)
    app = tyro.extras.SubcommandApp()
    for command in COMMANDS:
        app.command(name=command.__name__.rstrip("_"))(command)
    try:
        status = app.cli(prog="rodsight", description=__doc__, args=arguments)
    except InputError as error:
        print(f"rodsight: {error}", file=sys.stderr)
        status = 2
    except KeyboardInterrupt:
        print("rodsight: interrupted; the same command goes on from here", file=sys.stderr)
        status = 130
    except BrokenPipeError:
        status = 1
    sys.exit(status)


def _request(
    experiment: Path,
    out: Path | None,
    frames: str | None,
    settings: tuple[str, ...],
    sweeps: str | None,
    quiet: bool,
    max_size: float | None = None,
    full_frames: tuple[int, ...] = (),
):  # type: ignore[no-untyped-def]
    from app.commands import Request

    if sweeps is not None:
        settings = (*settings, f"recording.sweeps={json.dumps(sweeps)}")
    console = Console(stderr=False, quiet=quiet)
    return Request(experiment, out, frames, settings, quiet, console, max_size, full_frames)

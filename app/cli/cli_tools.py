"""The less common commands: experiments made, the method measured, results compared and handed on. No logic here."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from .arguments import ExperimentPath, Frames, Out, Quiet, Settings


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
    from . import commands

    return commands.synth(
        out, quiet=quiet, preset=preset, seed=seed, photographs=photographs, noise=noise, depth=depth,
        jpeg_quality=jpeg_quality, png=png, grains=grains, frames=frame_count, step_degrees=step_degrees,
        pixel_size=pixel_size, reversal=reversal,
    )  # fmt: skip


def sensitivity(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    frames: Frames = None,
    settings: Settings = (),
    design: Annotated[
        Literal["oat", "sobol"], tyro.conf.arg(help="one factor at a time, or all at once in a space-filling design")
    ] = "oat",
    factors: Annotated[
        tuple[str, ...],
        tyro.conf.arg(metavar="NAME[=LOW:HIGH]", help="what is varied, and over what range; default: everything"),
    ] = (),
    samples: Annotated[int | None, tyro.conf.arg(metavar="N", help="runs of --design sobol; default 64")] = None,
    seed: Annotated[int, tyro.conf.arg(help="of the noise and of the design")] = 0,
    workers: Annotated[int | None, tyro.conf.arg(metavar="N", help="processes; default: one for every core")] = None,
    scheduler: Annotated[
        str | None, tyro.conf.arg(metavar="ADDRESS", help="run on the machines of this dask scheduler instead")
    ] = None,
    as_json: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(name="json", help="print JSON")] = False,
    quiet: Quiet = False,
) -> int:
    """Vary what nobody knows exactly, and see how much the forces depend on it.

    Factors and their ranges: friction, wall_friction (× 0.8 to 1.2); precision, overlap, kappa, sweeps, and threshold
    of a single chain (× 0.5 to 2); position_noise, rotation_noise (1 to 2 standard deviations more); radius_scatter
    (0.05 to 0.1 %); radius_error, pixel_size (± 0.05 %); reset (at rearrangements, at one photograph); spacing (every
    second photograph); first_frame (1 to 3 later). In experiment.toml: [sensitivity.ranges] friction = [0.7, 1.3].

    Example: rodsight sensitivity sample_data/shear --factors friction=0.7:1.3 kappa
    """
    from . import commands

    request = commands.Request(experiment, out, frames, settings, quiet, Console(quiet=quiet))
    return commands.sensitivity(
        request, design=design, wanted=factors, samples=samples, seed=seed, workers=workers, scheduler=scheduler,
        as_json=as_json,
    )  # fmt: skip


def study(
    subject: Annotated[
        Literal["paper", "accuracy", "status", "uncertainty"],
        tyro.conf.Positional,
        tyro.conf.arg(help="the paper's claims; r against noise; trust and status refitted; coverage of error bars"),
    ],
    /,
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="of the simulated packings")] = (0, 1, 2),
    grains: Annotated[int, tyro.conf.arg(help="rods of a packing")] = 1172,
    estimator: Literal["ensemble", "nlgs"] = "ensemble",
    ensemble: Annotated[int, tyro.conf.arg(metavar="K", help="uncertainty: sequences solved again")] = 8,
    out: Annotated[Path, tyro.conf.arg(metavar="DIR", help="where simulated truths are kept")] = Path("runs/study"),
    quiet: Quiet = False,
) -> int:
    """Measure the method on simulated truth: minutes for each packing, kept for the next time.

    Example: rodsight study paper --seeds 0 1 --grains 400
    """
    from . import commands

    return commands.study(
        subject, seeds=seeds, grains=grains, estimator=estimator, ensemble=ensemble, folder=out, quiet=quiet
    )


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
    from . import sharing

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
    from . import comparing

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
    from . import exporting
    from .commands import progress_of

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
    from . import importing

    return importing.import_dic(
        source, out, pixel_size=pixel_size, interval=interval, height=height, precision=precision,
        console=Console(quiet=quiet),
    )  # fmt: skip

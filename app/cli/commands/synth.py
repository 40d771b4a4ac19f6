"""The command that makes synthetic experiments: synth."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from rich.console import Console
from tyro.conf import Positional, arg

from ...process.counts import state_count
from ...process.errors import InputError, RunError
from ...synthetic.scenarios.preset_names import FringedPreset, MeasuredPreset, PhotographedPreset, ScenarioName
from ..arguments import Flag, Quiet
from ..terminal import progress_of

if TYPE_CHECKING:
    from ...process.progress import Progress


def synth(
    out: Annotated[Path, Positional, arg(metavar="OUT", help="folder to write")],
    /,
    preset: Annotated[
        PhotographedPreset | MeasuredPreset | FringedPreset | ScenarioName,
        arg(
            help="small, paper and 1g2e can be photographed; 1g2e: the apparatus of the method's authors, with corner "
            "discs, a measured load and .0267° of shear a photograph; photoelastic: discs and their forces as PeGS "
            "writes them, for rodsight import pegs; fringes: photographs of such discs with their fringes; "
            "stiff_fringes: of discs whose overlaps noise hides; the others "
            "are scenarios of tracks: --no-photographs"
        ),
    ] = "small",
    seed: Annotated[int, arg(help="of the packing, its paint and its noise")] = 0,
    photographs: Annotated[bool, arg(help="render photographs; otherwise write tracks")] = True,
    noise: Annotated[
        float | None, arg(help="of a tracked position [m], with --no-photographs; default: the preset's")
    ] = None,
    depth: Annotated[Literal[8, 16], arg(help="bits of a photograph")] = 8,
    jpeg_quality: Annotated[int | None, arg(help="of 8-bit photographs, 1 to 100; default: the preset's")] = None,
    png: Annotated[Flag, arg(help="write PNG, not JPEG")] = False,
    grains: Annotated[int | None, arg(help="number of rods; default: the preset's")] = None,
    frame_count: Annotated[int | None, arg(name="frames", help="number of photographs; default: the preset's")] = None,
    step_degrees: Annotated[float | None, arg(help="shear between photographs [°]")] = None,
    pixel_size: Annotated[float | None, arg(help="side of a pixel [m]")] = None,
    reversal: Annotated[Flag, arg(help="reverse the shear half way")] = False,
    radius_error: Annotated[
        float, arg(help="error that all stated radii share, as a fraction: -0.02 states them 2 % too small")
    ] = 0.0,
    quiet: Quiet = False,
) -> int:
    """Make a synthetic experiment with its truth: explicit DEM, walls, speckle photographs.

    The apparatus 1γ2ε, tracks: rodsight synth my_test --preset 1g2e --no-photographs --grains 300

    A scenario of tracks: rodsight synth no_plate --preset isotropic --no-photographs

    Example: rodsight synth my_test --preset small --seed 3
    """
    from ...synthetic.scenarios.scenario_folder import make_scenario
    from ...synthetic.synthesis import SynthesisSettings, synthesize

    with _at_rest(out), progress_of(quiet) as progress:
        if preset in ("small", "paper", "1g2e"):
            made = synthesize(
                out,
                SynthesisSettings(
                    preset=preset,
                    seed=seed,
                    photographs=photographs,
                    noise=noise,
                    depth=depth,
                    jpeg_quality=jpeg_quality,
                    png=png,
                    grains=grains,
                    frames=frame_count,
                    step_degrees=step_degrees,
                    pixel_size=pixel_size,
                    reversal=reversal,
                    radius_error=radius_error,
                ),
                progress=progress,
            )
        else:
            if photographs and preset not in ("photoelastic", *get_args(FringedPreset)):
                raise InputError("synth", f"--preset {preset}", "makes tracks, not photographs: add --no-photographs")
            refused = {
                "--frames": None if preset in get_args(FringedPreset) else frame_count,
                "--step-degrees": step_degrees, "--pixel-size": pixel_size, "--jpeg-quality": jpeg_quality,
                "--png": png, "--reversal": reversal, "--radius-error": radius_error,
            }  # fmt: skip
            for option, value in refused.items():
                if value:
                    raise InputError("synth", f"{option} with preset {preset}", "applies to photographed presets only")
            if preset == "photoelastic":
                return _photoelastic(out, seed, grains, progress, quiet=quiet)
            if preset in ("fringes", "stiff_fringes"):
                from ...synthetic.photoelastic.fringe_photographs import make_fringed

                made = make_fringed(out, seed, preset=preset, grains=grains, frames=frame_count, progress=progress)
            else:
                made = make_scenario(out, preset, seed, grains=grains, noise=noise, progress=progress)
    if not quiet:
        content = f"{state_count(len(made.truth.radius), 'rod')}, {state_count(made.truth.frame_count, 'frame')}"
        Console().print(f"{out}: {content}. Next: rodsight run {out}", highlight=False)
    return 0


def _photoelastic(out: Path, seed: int, grains: int | None, progress: Progress, *, quiet: bool) -> int:
    from ...synthetic.photoelastic.pegs_files import make_photoelastic

    made = make_photoelastic(out, seed, grains=grains, progress=progress)
    if not quiet:
        content = f"{state_count(len(made.truth.radius), 'disc')}, {state_count(made.truth.frame_count, 'photograph')}"
        command = f"rodsight import pegs {out} EXPERIMENT --pixel-size {made.pixel_size:.4g}"
        Console().print(f"{out}: {content}. Next: {command}", highlight=False, soft_wrap=True)
    return 0


@contextmanager
def _at_rest(out: Path) -> Iterator[None]:
    """Report in one line a simulation that does not come to rest."""
    from ...solver.dem.dem_truth import UnbalancedError

    try:
        yield
    except UnbalancedError as error:
        raise RunError(f"{out}: {error}; try another --seed or number of --grains") from None

"""An experiment set up from flags, by the same edits as on the page; a failure reverts all of them."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...exchange.foreign.file_formats import DEFAULT_PIXEL_SIZE
from ...exchange.photographic.opencv_calibration import read_calibration
from ...exchange.photographic.rod_readings import read_rods
from ...exchange.photographic.video_frames import duration, extract_frames, is_video
from ...experiment.photographs import Photographs
from ...experiment.pictures.image import Channel, Image, ImageSelection
from ...experiment.pictures.picture_file import read_photograph
from ...process.atomic import write_atomically
from ...process.errors import InputError
from ...process.frame_range import ALL_FRAMES, FrameRange
from ...tracking.detection.channels import View, compare_views
from ...tracking.detection.detect import Detection, DetectionSettings, refine_grains
from ...tracking.detection.rim_quality import describe_faint_rims, describe_scale, describe_wide_rims
from ...tracking.outline.missing_discs import add_missing_discs
from ...tracking.texture_or_outline import prefer_outlines
from . import edits
from .draft import Draft
from .experiment_folders import valid_name
from .found_walls import replace_unseen_bars, set_found_walls
from .setup_picture import draw_setup
from .validation import ValidationResult, validate

PICTURE = "understood.png"
MOST_VIEWS, KEPT = 3, 0.8  # of a photograph that are tried; fraction of the discs of the small copy
KEPT_IN_CLASSES = 0.98  # of the rods must be found again with the sizes that nearly all have
ASSUMED_INTERVAL = 1.0  # s
FOUND, NONE = "auto", "none"


@dataclass(frozen=True, slots=True)
class SetupFlags:
    """Values of the flags, in SI units; None: not given."""

    photographs: str
    name: str | None = None
    pixel_size: float | None = None
    interval: float | None = None
    radii: tuple[float, ...] = ()
    walls: str = FOUND  # auto: found around the rods; none; or a table of their ends in metres
    pressure: Mapping[str, float] = field(default_factory=dict)  # [Pa] by wall
    material: Mapping[str, Any] = field(default_factory=dict)
    channel: Channel | None = None
    region: tuple[int, ...] = ()  # [px] first column and row, last column and row
    follow: str | None = None  # texture or outline
    radius_range: tuple[float, float] | None = None  # [px] where the radii are unknown
    frames: FrameRange = ALL_FRAMES  # of a video
    lens: Path | None = None  # calibration of OpenCV
    grains: Path | None = None  # rods as another program has found them


def initialise(folder: Path, flags: SetupFlags) -> ValidationResult:
    """Write experiment.toml, grains.csv, walls.csv and a picture to check them by, in a folder that may be new.

    Raises
    ------
    InputError
        A value is wrong, or the experiment exists already; nothing is written then.
    """
    draft = Draft(folder)
    if draft.file.exists():
        raise InputError(draft.file, "", "is there already: change it by rodsight open, or delete it")
    with ExitStack() as on_failure:
        if not folder.is_dir():
            _make(folder)
            on_failure.callback(_remove_empty, folder)
        flags, video = _without_video(folder, flags, on_failure)
        found = _initialise(folder, draft, flags, video)
        on_failure.pop_all()
    return found


def _make(folder: Path) -> None:
    """Create a folder in one that exists: a wrong path is an error, and not a tree of folders."""
    if folder.exists():
        raise InputError(folder, "", "is no folder; give the one that holds the photographs, or a new one")
    if not folder.absolute().parent.is_dir():
        raise InputError(folder, "", "cannot be created: the folder that should hold it does not exist")
    folder.mkdir()


def _remove_empty(folder: Path) -> None:
    if not any(folder.iterdir()):
        folder.rmdir()


def _initialise(folder: Path, draft: Draft, flags: SetupFlags, video: list[str]) -> ValidationResult:
    photographs = Photographs.matching(folder, flags.photographs)
    pixel_size = _pixel_size(flags)
    name = flags.name if flags.name is not None else valid_name(folder.resolve().name)
    with draft.one_step("new experiment"):
        edits.begin(draft, name, flags.photographs)
        keys = {
            "photographs.interval": ASSUMED_INTERVAL if flags.interval is None else flags.interval,
            "photographs.pixel_size": pixel_size,
            "photographs.radii": list(flags.radii) or None, "photographs.channel": flags.channel,
            "photographs.region": list(flags.region) or None, "photographs.follow": flags.follow,
            "photographs.lens": None if flags.lens is None else read_calibration(flags.lens, photographs.shape),
            **{f"material.{key}": value for key, value in flags.material.items() if value is not None},
        }  # fmt: skip
        draft.set_keys("values of the flags", {key: value for key, value in keys.items() if value is not None})
        _without_errors(draft, "photographs")
        selection = ImageSelection(flags.channel or "grey", flags.region or None)  # type: ignore[arg-type]
        views, remarks = _choose_views(photographs, flags, selection)
        view, detection, left_out = _detect(draft, flags, photographs, selection, views)
        selection = replace(selection, channel=view.channel)  # type: ignore[arg-type]
        first = selection.cut(_first(photographs, selection))
        detection, classes = _in_classes(first, view, detection, flags, _without_errors(draft, "photographs", "scale"))
        found, detection, notes = _find_rods_and_walls(draft, flags, first, detection)
        follow, how = _choose_follow(photographs, flags, selection, view, found)
        keys = {"photographs.channel": view.channel if view.channel != "grey" else None, "photographs.follow": follow}
        draft.set_keys("channel and following", {key: value for key, value in keys.items() if value is not None})
        found = _without_errors(draft, "photographs")
        plain, followed = [], []
        if flags.walls == FOUND:
            files = photographs.files[:2]
            images = [selection.cut(read_photograph(file, channel=selection.channel)) for file in files]
            plain, followed = replace_unseen_bars(draft, images, found, flags.pressure)
        found = _without_errors(draft, "photographs")
        write_atomically(folder / PICTURE, draw_setup(_first(photographs, selection), found))
        rims = [] if flags.grains is not None else [describe_faint_rims(detection)]
        if not flags.radii and flags.grains is None:
            rims.append(describe_wide_rims(view.lit(first), detection))
        stated = {
            "photographs": video, "scale": [describe_scale(first, detection)] if flags.radii else [],
            "rods": [*left_out, *classes, *how, *rims], "walls": [*notes, *plain],
        }  # fmt: skip
    found.steps["rods"].messages += remarks  # of what is seen, which is no reason to look again
    found.steps["walls"].messages += followed
    for step, sentence in ((step, each) for step, several in stated.items() for each in several if each):
        found.steps[step].add_warning(sentence)
    if flags.interval is None:
        found.steps["photographs"].add_warning(
            f"The time between photographs is unknown: {ASSUMED_INTERVAL:g} s is assumed, on which velocities depend. "
            "Give --interval, or set it by rodsight open."
        )
    if flags.pixel_size is None:
        found.steps["scale"].add_warning(
            f"The pixel size is unknown: {pixel_size:g} m is assumed, on which lengths and stresses depend. Give "
            "--pixel-size, or measure it by rodsight open."
        )
    return found


def _pixel_size(flags: SetupFlags) -> float:
    """Return the stated pixel size [m], or an assumed one where no flag is in metres or pascal."""
    in_metres = {"--radii": flags.radii, "--pressure": flags.pressure, "--walls": flags.walls not in (FOUND, NONE)}
    for option, given in in_metres.items():
        if given and flags.pixel_size is None:
            raise InputError("--pixel-size", "", f"is missing: {option} needs the scale of the photographs")
    return DEFAULT_PIXEL_SIZE if flags.pixel_size is None else flags.pixel_size


def _choose_views(
    photographs: Photographs, flags: SetupFlags, selection: ImageSelection
) -> tuple[list[View], list[str]]:
    """Order channels, and light or dark discs, by how much of the rods' outlines is seen; also a sentence on them.

    With known radii the picture is first taken as it is, which most often shows all rods.
    """
    plain = View(selection.channel, False, 0, 0.0, None)
    if flags.follow == "texture" and not flags.radii:
        return [plain], []
    channels = {name: selection.cut(image) for name, image in photographs.in_channels(0).items()}
    if flags.channel is not None:
        channels = dict.fromkeys(channels, channels[flags.channel])  # not coloured: light and dark discs are compared
    radii = tuple(radius / _pixel_size(flags) for radius in flags.radii)
    views = compare_views(channels, DetectionSettings(radii, flags.radius_range))
    if flags.channel is not None:
        views = [replace(view, channel=flags.channel) for view in views]
    if views[0].count == 0:
        return [plain], []
    shown = ["A small copy of the first photograph shows " + ", ".join(v.describe() for v in views[:4]) + "."]
    return ([replace(plain, count=views[0].count), *views] if flags.radii else views), shown


def _detect(
    draft: Draft, flags: SetupFlags, photographs: Photographs, selection: ImageSelection, views: Sequence[View]
) -> tuple[View, Detection, list[str]]:
    """Detect the rods in the first view that keeps what its small copy shows; else in the best of a few."""
    validated = _without_errors(draft, "photographs", "scale", "material")
    if flags.grains is not None:
        rods, notes = read_rods(flags.grains, photographs.shape)
        count = len(rods.id)
        return views[0], Detection(rods.x, rods.y, rods.radius, np.full(count, np.nan), np.ones(count)), notes
    tried: list[tuple[View, Detection]] = []
    for view in views[:MOST_VIEWS]:
        image = selection.cut(read_photograph(photographs.files[0], channel=view.channel))  # type: ignore[arg-type]
        sizes = view.radius_range if flags.radius_range is None else flags.radius_range
        detection = edits.detect(view.lit(image), validated, flags.radii, sizes)
        if flags.follow != "texture":
            detection = add_missing_discs(image, detection)
        tried.append((view, detection))
        if tried[-1][1].count >= KEPT * view.count:
            break
    view, detection = max(tried, key=lambda each: each[1].seen_area)
    if detection.count == 0:
        cure = "check --radii and --pixel-size" if flags.radii else "give their --radii"
        raise InputError(validated.files[0], "", f"no rods were found; {cure}, or mark them by rodsight open")
    return view, detection, []


def _in_classes(
    first: Image, view: View, detection: Detection, flags: SetupFlags, found: ValidationResult
) -> tuple[Detection, list[str]]:
    """Detect rods of a few sizes once more with these, so that interrupted rims are found; also a sentence on them."""
    sizes = None if flags.radii or flags.grains is not None else edits.evident_classes(detection.radius)
    if sizes is None or found.scale is None:
        return detection, []
    again = edits.detect(view.lit(first), found, (sizes * found.scale.mean_size).tolist())
    if again.count < KEPT_IN_CLASSES * detection.count:
        return detection, []
    listed = ", ".join(f"{1e3 * size * found.scale.mean_size:.4g}" for size in sizes)
    many = f"{len(sizes)} sizes" if len(sizes) > 1 else "one size"
    return again, [f"The rods have {many}, radius {listed} mm in the photograph, which is used. Better: --radii."]


def _without_video(folder: Path, flags: SetupFlags, on_failure: ExitStack) -> tuple[SetupFlags, list[str]]:
    """Replace a video by photographs of its frames, and the interval by their times; also return a sentence."""
    if not is_video(flags.photographs):
        if flags.frames != ALL_FRAMES:
            raise InputError("--frames", str(flags.frames), "applies to videos only; photographs are chosen by a run")
        return flags, []
    video = folder / flags.photographs
    frames = folder / f"{video.stem}_frames"
    # A video that plays for less than the time between two photographs was made of them: each frame is one.
    lapse = flags.interval is not None and duration(video) < flags.interval
    count, interval = extract_frames(video, frames, flags.frames, None if lapse else flags.interval)
    on_failure.callback(shutil.rmtree, frames)
    sentence = f"{count} frames of {video.name}, {interval:.4g} s apart, are photographs in {frames.name}."
    if lapse and flags.interval is not None:
        played, interval = count * interval, flags.interval
        sentence = (
            f"{video.name} plays for {played:.4g} s, less than --interval {interval:g}: each of its {count} frames is "
            f"a photograph in {frames.name}, {interval:g} s apart."
        )
    return replace(flags, photographs=f"{frames.name}/*.png", interval=interval), [sentence]


def _choose_follow(
    photographs: Photographs, flags: SetupFlags, selection: ImageSelection, view: View, found: ValidationResult
) -> tuple[str | None, list[str]]:
    """Choose what of the rods is followed by trying both ways from the first photograph to the second."""
    if flags.follow is not None:
        return flags.follow, []
    if view.dark:
        return "outline", ["Discs that are darker than their surroundings are followed by their outlines."]
    rods = found.rods
    if len(photographs) < 2 or rods is None:
        return None, []
    images = [selection.cut(read_photograph(file, channel=selection.channel)) for file in photographs.files[:2]]
    reason = prefer_outlines(images[0], images[1], refine_grains(images[0], rods.x, rods.y, rods.radius))
    return ("outline", [reason]) if reason else (None, [])


def _first(photographs: Photographs, selection: ImageSelection) -> Image:
    return read_photograph(photographs.files[0], channel=selection.channel)


def _find_rods_and_walls(
    draft: Draft, flags: SetupFlags, first: Image, detection: Detection
) -> tuple[ValidationResult, Detection, list[str]]:
    """Set rods, walls and pressures; also return the rods, and sentences on what was left out."""
    notes: list[str] = []
    circles_found, detection = detection, edits.within_picture(detection, first)
    edits.set_rods(draft, "rods", edits.as_guess(detection), flags.radii)
    if flags.walls == NONE:
        if flags.pressure:
            raise InputError("--pressure", next(iter(flags.pressure)), "loads a wall, but there are none: --walls none")
    elif flags.walls == FOUND:
        detection, notes = set_found_walls(
            draft, first, detection, circles_found, flags.radii,
            loaded=bool(flags.pressure), known=flags.grains is not None,
        )  # fmt: skip
    else:
        source = Path(flags.walls)
        if not source.is_file():
            raise InputError("--walls", flags.walls, "is neither auto nor none, and there is no such file")
        if source.resolve() != (draft.folder / edits.WALLS).resolve():
            write_atomically(draft.folder / edits.WALLS, Path(source).read_bytes())
        draft.set_keys("walls", {"walls.file": edits.WALLS})
    for wall, pressure in flags.pressure.items():
        found = validate(draft)
        if found.walls is not None and wall not in found.walls.name:
            there = ", ".join(found.walls.name)
            raise InputError("--pressure", f"{wall}={pressure:g}", f"there is no such wall; there are {there}")
        edits.set_plate(draft, found, wall, {"pressure": pressure})
    return _without_errors(draft, *validate(draft).steps), detection, notes


def _without_errors(draft: Draft, *steps: str) -> ValidationResult:
    """Validate the draft; raise InputError where a given value is wrong, not where one is missing."""
    found = validate(draft)
    for name in steps:
        for sentence in found.steps[name].errors:
            raise InputError(draft.file, "", sentence)
    return found

"""Corrupted inputs of every kind, each with the command that reads it."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from .attempt import Case, attempt
from .corruption import BYTES, NUMBERS, TABLE, TEXT, WORDS, Corruption, corrupt_store
from .foreign_files import FORMS, make_bounded, write_forms

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20", "--sweeps", "none", "--quiet")


@dataclass(frozen=True, slots=True)
class Originals:
    """Valid input of every kind."""

    tracked: Path
    photographed: Path
    dic: Path
    solved: Path  # a run's folder, beside `tracked`
    foreign: Path  # FORMS, each in a numbered folder
    bounded: Path  # experiments with other boundaries
    tables: dict[str, tuple[str, ...]]  # of `bounded`, by name
    work: Path  # for corrupted copies


def make_originals(folder: Path) -> Originals:
    """Make one input of each kind."""
    tracked, photographed, dic, solved = (folder / name for name in ("tracked", "photographed", "dic", "solved"))
    synthesize(tracked, SynthesisSettings(grains=16, frames=3, photographs=False, noise=1e-5, seed=1))
    synthesize(photographed, SynthesisSettings(grains=12, frames=3, seed=2))
    text = (photographed / "experiment.toml").read_text()
    text = text.replace("[photographs]\n", '[photographs]\ncorrections = "corrections.csv"\n')
    (photographed / "experiment.toml").write_text(text)
    ids = [line.split(",")[0] for line in (photographed / "grains.csv").read_text().splitlines()[1:3]]
    (photographed / "corrections.csv").write_text(
        f"frame,id,x,y,theta\n1,{ids[0]},100.0,120.0,\n2,{ids[1]},lost,lost,lost\n"
    )
    dic.mkdir()
    for number in range(2):
        rows = "".join(
            f"{10 * k + 30} {7 * k + 40} 0.0 {20 + k} 0.5 0.25 0.01 0.5 0.25 0.01 0.99 0.99 0.99\n" for k in range(6)
        )
        (dic / f"dic_out_{number}.txt").write_text(f"6\n{rows}")
    ended = attempt(["solve", str(tracked), "--out", str(solved), *FEW])
    assert ended.status == 0, ended.errors
    # Without checksums, which would refuse every corrupted file.
    (solved / "manifest.json").write_text(json.dumps({"experiment": str(tracked / "experiment.toml")}))
    ids = [line.split(",")[0] for line in (tracked / "grains.csv").read_text().splitlines()[1:4]]
    verdict = '{{"frame": 1, "reviewer": "anna", "a": {}, "b": {}, "verdict": "contact", "seconds": 1.5}}\n'
    (solved / "verdicts.jsonl").write_text(verdict.format(ids[0], ids[1]) + verdict.format(ids[1], ids[2]))
    assert attempt(["check", str(photographed), "--quiet"]).status == 0
    for arguments in (_reading(solved, random.Random(seed)) for seed in range(8)):  # imports modules before forking
        assert attempt(arguments).status == 0, arguments
    shutil.rmtree(solved / "exported", ignore_errors=True)
    (solved / "verdicts.csv").unlink(missing_ok=True)
    foreign, bounded = folder / "foreign", folder / "bounded"
    write_forms(foreign)
    for number, (form, files, options) in enumerate(FORMS):
        source = foreign / str(number) / next(iter(files)) if len(files) == 1 else foreign / str(number)
        ended = attempt(["import", form, str(source), str(folder / "imported" / str(number)), *options, "--quiet"])
        assert ended.status == 0, ended.errors
    tables = make_bounded(tracked, bounded)
    for name in tables:
        ended = attempt(["check", str(bounded / name), "--quiet"])
        assert ended.status == 0, ended.errors
    return Originals(tracked, photographed, dic, solved, foreign, bounded, tables, folder / "work")


def make_cases(originals: Originals, count: int, seed: int = 0) -> Iterator[Case]:
    """Yield `count` cases, all kinds in turn; the same seed gives the same cases."""
    for number in range(count):
        name, make = KINDS[number % len(KINDS)]
        rng = random.Random(f"{seed} {number}")
        yield f"{name} {seed} {number}", lambda make=make, rng=rng: make(originals, rng)


def _copy(original: Path, work: Path) -> Path:
    shutil.rmtree(work, ignore_errors=True)
    return Path(shutil.copytree(original, work / original.name))


def _corrupted(original: Path, work: Path, file: str, ways: tuple[Corruption, ...], rng: random.Random) -> Path:
    copy = _copy(original, work)
    target = copy / file
    content = target.read_bytes()
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        content = rng.choice(ways)(rng, content)
    target.write_bytes(content)
    return copy


def _config(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    original = rng.choice((originals.tracked, originals.photographed))
    return ["check", str(_corrupted(original, originals.work, "experiment.toml", TEXT, rng)), "--quiet"], None


def _table(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    file = rng.choice(("tracks.csv", "grains.csv", "times.csv", "walls.csv", "truth_contacts.csv"))
    return ["check", str(_corrupted(originals.tracked, originals.work, file, TABLE, rng)), "--quiet"], None


def _pixel_table(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    file = rng.choice(("grains.csv", "corrections.csv", "corrections.csv", "walls.csv"))
    return ["check", str(_corrupted(originals.photographed, originals.work, file, TABLE, rng)), "--quiet"], None


def _image(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    photograph = rng.choice(sorted((originals.photographed / "photos").iterdir()))
    file = f"photos/{photograph.name}"
    return ["check", str(_corrupted(originals.photographed, originals.work, file, BYTES, rng)), "--quiet"], None


def _solve(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    file = rng.choice(("experiment.toml", "tracks.csv", "grains.csv", "walls.csv"))
    copy = _corrupted(originals.tracked, originals.work, file, TEXT, rng)
    out = originals.work / "out"
    return ["solve", str(copy), "--out", str(out), *FEW], out


def _store(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    copy = _copy(originals.solved, originals.work)
    corrupt_store(rng, copy / "results.h5")
    return _reading(copy, rng), copy / "exported"


def _store_bytes(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    copy = _corrupted(originals.solved, originals.work, "results.h5", BYTES, rng)
    return _reading(copy, rng), copy / "exported"


def _verdicts(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    copy = _corrupted(originals.solved, originals.work, "verdicts.jsonl", TEXT, rng)
    return ["review", str(copy), "--export-csv", str(copy / "verdicts.csv")], None


def _reading(copy: Path, rng: random.Random) -> list[str]:
    return rng.choice((
        ["score", str(copy), "--json"],
        ["export", "tables", str(copy), "--out", str(copy / "exported")],
        ["review", str(copy), "--export-csv", str(copy / "verdicts.csv")],
    ))  # fmt: skip


def _import(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    file = f"dic_out_{rng.randrange(2)}.txt"
    copy = _corrupted(originals.dic, originals.work, file, TEXT, rng)
    out = originals.work / "imported"
    return ["import", "dic", str(copy), str(out), "--pixel-size", "1e-4", "--quiet"], out


def _foreign(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    number = rng.randrange(len(FORMS))
    form, files, options = FORMS[number]
    copy = _corrupted(originals.foreign / str(number), originals.work, rng.choice(sorted(files)), TABLE, rng)
    out = originals.work / "imported"
    source = copy / next(iter(files)) if len(files) == 1 else copy
    return ["import", form, str(source), str(out), *options, "--quiet"], out


def _bounded(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    name = rng.choice(sorted(originals.tables))
    file = rng.choice((*originals.tables[name], "experiment.toml"))
    copy = _corrupted(originals.bounded / name, originals.work, file, TABLE if file.endswith("csv") else TEXT, rng)
    out = originals.work / "out"
    if rng.random() < 0.7:
        return ["check", str(copy), "--quiet"], None
    return ["solve", str(copy), "--out", str(out), *FEW], out


def _setting(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    key = rng.choice(SETTINGS)
    value = rng.choice((*NUMBERS, *WORDS)).replace("\x00", "")
    return ["check", str(originals.tracked), "--quiet", f"--set={key}={value}"], None


def _frames(originals: Originals, rng: random.Random) -> tuple[list[str], Path | None]:
    part = ("", "0", "1", "2", "3", "4", "-1", "9" * 30, "nan", "a", "1.0", " 1", "1:2", "²", "٣", "+1", "_1", "1_0")
    text = rng.choice((":", ":", ":", "", "::", ";")).join((rng.choice(part), rng.choice(part)))
    out = originals.work / "out"
    shutil.rmtree(originals.work, ignore_errors=True)
    return ["track", str(originals.tracked), "--out", str(out), "--quiet", f"--frames={text}"], out


SETTINGS = (
    "solver.kappa", "solver.sweeps", "material.friction", "material.density", "walls.top.pressure", "name",
    "solver.estimator", "tracks.positions", "tracks.precision", "solver", "", "material.gravity", "nowhere.key",
    "a.b.c.d", "walls",
)  # fmt: skip

Make = Callable[[Originals, random.Random], tuple[list[str], "Path | None"]]
KINDS: tuple[tuple[str, Make], ...] = (
    ("toml", _config), ("table", _table), ("toml", _config), ("table", _table), ("pixels", _pixel_table),
    ("image", _image), ("store", _store), ("table", _table), ("store bytes", _store_bytes), ("verdicts", _verdicts),
    ("import", _import), ("foreign", _foreign), ("bounded", _bounded), ("foreign", _foreign), ("bounded", _bounded),
    ("setting", _setting), ("frames", _frames), ("toml", _config), ("solve", _solve), ("setting", _setting),
    ("image", _image),
)  # fmt: skip

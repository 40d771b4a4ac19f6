"""Spoiled inputs of every kind, as many as are asked for, each with the command that reads it."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rodsight.synthetic.synthesis import synthesize

from .attempt import Case, attempt
from .foreign_files import FORMS, make_bounded, write_forms
from .spoiling import BYTES, NUMBERS, TABLE, TEXT, WORDS, Spoil, spoil_store

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20", "--sweeps", "none", "--quiet")


@dataclass(frozen=True, slots=True)
class Originals:
    """Good input of every kind."""

    tracked: Path
    photographed: Path
    dic: Path
    solved: Path  # a run's folder, beside `tracked`
    foreign: Path  # FORMS, each in a folder by its number
    bounded: Path  # experiments with other boundaries
    tables: dict[str, tuple[str, ...]]  # of these, by their names
    work: Path  # where spoiled copies go


def make_originals(folder: Path) -> Originals:
    """Make one of each."""
    tracked, photographed, dic, solved = (folder / name for name in ("tracked", "photographed", "dic", "solved"))
    synthesize(tracked, grains=16, frames=3, photographs=False, noise=1e-5, seed=1)
    synthesize(photographed, grains=12, frames=3, seed=2)
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
    assert ended.status == 0, ended.said
    # Without checksums, for which every spoiled file would be refused.
    (solved / "manifest.json").write_text(json.dumps({"experiment": str(tracked / "experiment.toml")}))
    ids = [line.split(",")[0] for line in (tracked / "grains.csv").read_text().splitlines()[1:4]]
    verdict = '{{"frame": 1, "reviewer": "anna", "a": {}, "b": {}, "verdict": "contact", "seconds": 1.5}}\n'
    (solved / "verdicts.jsonl").write_text(verdict.format(ids[0], ids[1]) + verdict.format(ids[1], ids[2]))
    assert attempt(["check", str(photographed), "--quiet"]).status == 0
    for arguments in (_reading(solved, random.Random(seed)) for seed in range(8)):  # forks find it imported
        assert attempt(arguments).status == 0, arguments
    shutil.rmtree(solved / "exported", ignore_errors=True)
    (solved / "verdicts.csv").unlink(missing_ok=True)
    foreign, bounded = folder / "foreign", folder / "bounded"
    write_forms(foreign)
    for number, (form, files, options) in enumerate(FORMS):
        source = foreign / str(number) / next(iter(files)) if len(files) == 1 else foreign / str(number)
        ended = attempt(["import", form, str(source), str(folder / "imported" / str(number)), *options, "--quiet"])
        assert ended.status == 0, ended.said
    tables = make_bounded(tracked, bounded)
    for name in tables:
        ended = attempt(["check", str(bounded / name), "--quiet"])
        assert ended.status == 0, ended.said
    return Originals(tracked, photographed, dic, solved, foreign, bounded, tables, folder / "work")


def make_cases(originals: Originals, count: int, seed: int = 0) -> Iterator[Case]:
    """`count` cases, all kinds in turn; the same seed gives the same ones."""
    for number in range(count):
        name, make = KINDS[number % len(KINDS)]
        chance = random.Random(f"{seed} {number}")
        yield f"{name} {seed} {number}", lambda make=make, chance=chance: make(originals, chance)


def _copy(original: Path, work: Path) -> Path:
    shutil.rmtree(work, ignore_errors=True)
    return Path(shutil.copytree(original, work / original.name))


def _spoiled(original: Path, work: Path, file: str, ways: tuple[Spoil, ...], chance: random.Random) -> Path:
    copy = _copy(original, work)
    target = copy / file
    content = target.read_bytes()
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        content = chance.choice(ways)(chance, content)
    target.write_bytes(content)
    return copy


def _config(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    original = chance.choice((originals.tracked, originals.photographed))
    return ["check", str(_spoiled(original, originals.work, "experiment.toml", TEXT, chance)), "--quiet"], None


def _table(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    file = chance.choice(("tracks.csv", "grains.csv", "times.csv", "walls.csv", "truth_contacts.csv"))
    return ["check", str(_spoiled(originals.tracked, originals.work, file, TABLE, chance)), "--quiet"], None


def _pixel_table(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    file = chance.choice(("grains.csv", "corrections.csv", "corrections.csv", "walls.csv"))
    return ["check", str(_spoiled(originals.photographed, originals.work, file, TABLE, chance)), "--quiet"], None


def _image(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    photograph = chance.choice(sorted((originals.photographed / "photos").iterdir()))
    file = f"photos/{photograph.name}"
    return ["check", str(_spoiled(originals.photographed, originals.work, file, BYTES, chance)), "--quiet"], None


def _solve(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    file = chance.choice(("experiment.toml", "tracks.csv", "grains.csv", "walls.csv"))
    copy = _spoiled(originals.tracked, originals.work, file, TEXT, chance)
    out = originals.work / "out"
    return ["solve", str(copy), "--out", str(out), *FEW], out


def _store(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    copy = _copy(originals.solved, originals.work)
    spoil_store(chance, copy / "results.h5")
    return _reading(copy, chance), copy / "exported"


def _store_bytes(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    copy = _spoiled(originals.solved, originals.work, "results.h5", BYTES, chance)
    return _reading(copy, chance), copy / "exported"


def _verdicts(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    copy = _spoiled(originals.solved, originals.work, "verdicts.jsonl", TEXT, chance)
    return ["review", str(copy), "--export-csv", str(copy / "verdicts.csv")], None


def _reading(copy: Path, chance: random.Random) -> list[str]:
    return chance.choice((
        ["score", str(copy), "--json"],
        ["export", "tables", str(copy), "--out", str(copy / "exported")],
        ["review", str(copy), "--export-csv", str(copy / "verdicts.csv")],
    ))  # fmt: skip


def _import(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    file = f"dic_out_{chance.randrange(2)}.txt"
    copy = _spoiled(originals.dic, originals.work, file, TEXT, chance)
    out = originals.work / "imported"
    return ["import", "dic", str(copy), str(out), "--pixel-size", "1e-4", "--quiet"], out


def _foreign(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    number = chance.randrange(len(FORMS))
    form, files, options = FORMS[number]
    copy = _spoiled(originals.foreign / str(number), originals.work, chance.choice(sorted(files)), TABLE, chance)
    out = originals.work / "imported"
    source = copy / next(iter(files)) if len(files) == 1 else copy
    return ["import", form, str(source), str(out), *options, "--quiet"], out


def _bounded(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    name = chance.choice(sorted(originals.tables))
    file = chance.choice((*originals.tables[name], "experiment.toml"))
    copy = _spoiled(originals.bounded / name, originals.work, file, TABLE if file.endswith("csv") else TEXT, chance)
    out = originals.work / "out"
    if chance.random() < 0.7:
        return ["check", str(copy), "--quiet"], None
    return ["solve", str(copy), "--out", str(out), *FEW], out


def _setting(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    key = chance.choice(SETTINGS)
    value = chance.choice((*NUMBERS, *WORDS)).replace("\x00", "")
    return ["check", str(originals.tracked), "--quiet", f"--set={key}={value}"], None


def _frames(originals: Originals, chance: random.Random) -> tuple[list[str], Path | None]:
    part = ("", "0", "1", "2", "3", "4", "-1", "9" * 30, "nan", "a", "1.0", " 1", "1:2", "²", "٣", "+1", "_1", "1_0")
    text = chance.choice((":", ":", ":", "", "::", ";")).join((chance.choice(part), chance.choice(part)))
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

"""What a study found: ranked, in a table for the terminal, and in files for other programs."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console
from rich.table import Table

from ..atomic import replacing, write_atomically
from ..errors import InputError
from ..experiment.reading.tables import write_table
from .design import Case, Design
from .factors import Factor
from .indices import MainEffects, main_effects
from .study import Effect

FILES = ("sensitivity.csv", "sensitivity.json", "sensitivity.parquet")
WIDTH = 150  # columns of a table that goes to a file
LITTLE = 0.02  # relative L2 below which a factor counts as of little weight
EXPLAINED = 0.7  # share of the variance below which main effects do not tell the whole story
# Results of a design whose variance is divided among the factors.
RESULTS = ("relative_l2", "r_fn", "scale", "friction_angle_change", "principal_direction_change")
HEADINGS = {
    "r_fn": "r(f_n)", "r_ft": "r(f_t)", "relative_l2": "L2", "scale": "scale", "friction_angle_change": "Δφ [°]",
    "principal_direction_change": "Δθ₁ [°]", "pressure": "p [kPa]", "contacts": "contacts", "trust": "trust",
    "true_r_fn": "true r", "true_relative_l2": "true L2",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Findings:
    """A finished study."""

    name: str  # of the experiment
    design: Design
    factors: tuple[Factor, ...]
    cases: list[Case]
    effects: list[Effect]  # of the cases
    nominal: Effect  # of the nominal run: what it says itself, and how it agrees with the truth

    def runs(self) -> list[tuple[Case, Effect]]:
        """Cases and their effects, one at a time: the strongest factor first, a factor's own runs together."""
        order = range(len(self.cases))
        if self.design == "oat":
            rank = {name: place for place, (name, _) in enumerate(self.ranking())}
            order = sorted(order, key=lambda k: (rank[self.cases[k].values[0][0]], self.cases[k].values[0][1]))
        return [(self.cases[k], self.effects[k]) for k in order]

    def ranking(self) -> list[tuple[str, float]]:
        """Factors and how much they matter, the strongest first.

        One at a time: the greatest relative L2 change of the forces; in a design: the share of that change's variance.
        """
        if self.design == "oat":
            strength = {each.name: -1.0 for each in self.factors}
            for case, effect in zip(self.cases, self.effects, strict=True):
                (name, _), *_ = case.values
                if not math.isnan(effect.relative_l2):
                    strength[name] = max(strength[name], effect.relative_l2)
        else:
            index = self.main_effects()["relative_l2"].index
            strength = {each.name: float(share) for each, share in zip(self.factors, index, strict=True)}
        return sorted(strength.items(), key=lambda item: -item[1])

    def main_effects(self) -> dict[str, MainEffects]:
        """Of a space-filling design, by result; runs that failed are left out."""
        unit = np.array(
            [
                [each.part_of(dict(case.values)[each.name]) for each in self.factors]
                for case, effect in zip(self.cases, self.effects, strict=True)
                if not effect.failure
            ]
        ).reshape(-1, len(self.factors))
        done = [effect for effect in self.effects if not effect.failure]
        if len(done) < 2 * len(self.factors) + 2:
            reason = next(effect.failure for effect in self.effects if effect.failure)
            raise InputError("--samples", str(len(self.cases)), f"only {len(done)} runs were possible: {reason}")
        return {name: main_effects(unit, np.array([getattr(each, name) for each in done])) for name in RESULTS}

    def sentence(self) -> str:
        """What matters most, and what does not."""
        labels = {each.name: each for each in self.factors}
        ranking = self.ranking()
        if self.design == "sobol":
            shares = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in ranking[:3])
            explained = self.main_effects()["relative_l2"].explained
            told = f"Of the variance of the change of the forces, these make most by themselves: {shares}"
            told += f"; all factors together {100.0 * explained:.0f} %"
            return told + (", the rest are interactions." if explained < EXPLAINED else ".")
        strongest = {name: strength for name, strength in ranking if strength >= LITTLE}
        weak = [name for name, strength in ranking if 0.0 <= strength < LITTLE]
        parts = []
        for name in list(strongest)[:3]:
            case, effect = max(
                ((c, e) for c, e in zip(self.cases, self.effects, strict=True) if c.values[0][0] == name),
                key=lambda pair: -1.0 if math.isnan(pair[1].relative_l2) else pair[1].relative_l2,
            )
            label = labels[name].label(case.values[0][1])
            parts.append(f"{name} ({label} changes the forces by {100.0 * effect.relative_l2:.0f} %)")
        told = f"What matters most: {', then '.join(parts)}." if parts else "Nothing that was varied matters much."
        return told + (f" Below {100.0 * LITTLE:.0f} %: {', '.join(weak)}." if weak else "")


def save_findings(findings: Findings, folder: Path) -> None:
    """Write a row per run as CSV and Parquet, and everything as JSON."""
    csv_file, json_file, parquet_file = (folder / name for name in FILES)
    columns = _columns(findings)
    with replacing(csv_file) as part:
        write_table(part, {name: ["" if _absent(v) else v for v in values] for name, values in columns.items()})
    with replacing(parquet_file) as part:
        pq.write_table(pa.table({name: [_known(v) for v in values] for name, values in columns.items()}), part)
    write_atomically(json_file, (json.dumps(as_json(findings), indent=1) + "\n").encode())


def as_json(findings: Findings) -> dict[str, Any]:
    """Everything that was found; null where there is no value."""
    ends = {each.name: each for each in findings.factors}
    told: dict[str, Any] = {
        "experiment": findings.name,
        "design": findings.design,
        "summary": findings.sentence(),
        "nominal": _plain(findings.nominal),
        "ranking": [
            {
                "factor": name,
                "strength": _known(strength) if strength >= 0 else None,
                "meaning": ends[name].meaning,
                "low": ends[name].low,
                "high": ends[name].high,
                "nominal": ends[name].nominal,
                "scale": ends[name].reading.value,
            }
            for name, strength in findings.ranking()
        ],
        "runs": [{"values": dict(case.values), **_plain(effect)} for case, effect in findings.runs()],
    }
    if findings.design == "sobol":
        names = [each.name for each in findings.factors]
        told["main_effects"] = {
            result: {
                "index": dict(zip(names, effects.index.tolist(), strict=True)),
                "change": dict(zip(names, effects.change.tolist(), strict=True)),
                "explained": effects.explained,
            }
            for result, effects in findings.main_effects().items()
        }
    return told


def print_findings(console: Console, findings: Findings) -> None:
    """Print the table, and a sentence on what matters most."""
    console.print(_effect_table(findings) if findings.design == "oat" else _design_table(findings))
    failed = [each.failure for each in findings.effects if each.failure]
    if failed:
        console.print(f"{len(failed)} runs were not possible: {failed[0]}", highlight=False, markup=False)
    console.print(findings.sentence(), highlight=False, markup=False)


def _effect_table(findings: Findings) -> Table:
    table = Table(title=f"{findings.name}: one at a time, against the nominal run", box=None, pad_edge=False)
    names = [name for name in HEADINGS if not (name.startswith("true_") and math.isnan(findings.nominal.true_r_fn))]
    table.add_column("factor", no_wrap=True)
    table.add_column("value", no_wrap=True)
    for name in names:
        table.add_column(HEADINGS[name], justify="right", no_wrap=True)
    table.add_row("nominal", "", *_cells(findings.nominal, names))
    known = {each.name: each for each in findings.factors}
    for case, effect in findings.runs():
        (name, value), *_ = case.values
        table.add_row(name, known[name].label(value), *_cells(effect, names))
    return table


def _design_table(findings: Findings) -> Table:
    title = f"{findings.name}: {len(findings.cases)} runs of a Sobol design; share of the variance, %"
    table = Table(title=title, box=None, pad_edge=False)
    table.add_column("factor", no_wrap=True)
    table.add_column("from", no_wrap=True)
    table.add_column("to", no_wrap=True)
    effects = findings.main_effects()
    for name in RESULTS:
        table.add_column(HEADINGS[name], justify="right", no_wrap=True)
    place = {each.name: number for number, each in enumerate(findings.factors)}
    for name, _ in findings.ranking():
        factor = findings.factors[place[name]]
        shares = (f"{100.0 * effects[result].index[place[name]]:.0f}" for result in RESULTS)
        low, high = factor.ends
        table.add_row(name, factor.label(low), factor.label(high), *shares)
    table.add_row("all together", "", "", *(f"{100.0 * effects[result].explained:.0f}" for result in RESULTS))
    return table


def _cells(effect: Effect, names: Sequence[str]) -> list[str]:
    formats = {
        "friction_angle_change": "+.1f", "principal_direction_change": "+.1f", "contacts": ".0f", "trust": ".2f",
        "scale": ".2f", "relative_l2": ".2f", "true_relative_l2": ".2f",
    }  # fmt: skip
    cells = []
    for name in names:
        value = getattr(effect, name)
        if math.isnan(value):
            cells.append("–")
        else:
            cells.append(f"{1e-3 * value:.1f}" if name == "pressure" else format(value, formats.get(name, ".3f")))
    return cells


def _columns(findings: Findings) -> dict[str, list[Any]]:
    runs = findings.runs()
    nominal = Case(())
    rows = [(nominal, findings.nominal), *runs]
    columns: dict[str, list[Any]] = {}
    if findings.design == "oat":
        columns["factor"] = [case.values[0][0] if case.values else "nominal" for case, _ in rows]
        columns["value"] = [case.values[0][1] if case.values else math.nan for case, _ in rows]
    else:
        for factor in findings.factors:
            columns[factor.name] = [dict(case.values).get(factor.name, factor.nominal) for case, _ in rows]
    for each in fields(Effect):
        columns[each.name] = [getattr(effect, each.name) for _, effect in rows]
    return columns


def _plain(effect: Effect) -> dict[str, Any]:
    return {name: _known(value) for name, value in asdict(effect).items()}


def _known(value: Any) -> Any:
    return None if _absent(value) else value


def _absent(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)

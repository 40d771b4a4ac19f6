"""Results of a study: ranked, as a table for the terminal, and as files for other programs."""

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

from ..experiment.reading.tables import write_table
from ..process.atomic import replacing, write_atomically
from ..process.counts import state_count
from ..process.errors import InputError
from .design import Case, Design
from .factors import Factor
from .indices import MainEffects, main_effects
from .study import Effect

FILES = ("sensitivity.csv", "sensitivity.json", "sensitivity.parquet")
WIDTH = 150  # columns of a table written to a file
NEGLIGIBLE = 0.02  # relative L2 below which the effect of a factor is negligible
MIN_EXPLAINED = 0.7  # fraction of the variance below which interactions are reported
# Results of a space-filling design whose variance is divided among the factors.
RESULTS = ("relative_l2", "r_fn", "scale", "friction_angle_change", "principal_direction_change")
HEADINGS = {
    "r_fn": "r(f_n)", "r_ft": "r(f_t)", "relative_l2": "L2", "scale": "scale", "friction_angle_change": "Δφ [°]",
    "principal_direction_change": "Δθ₁ [°]", "pressure": "p [kPa]", "contacts": "contacts", "trust": "trust",
    "true_r_fn": "true r", "true_relative_l2": "true L2",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class SensitivityResults:
    """Results of a finished study."""

    name: str  # of the experiment
    design: Design
    factors: tuple[Factor, ...]
    cases: list[Case]
    effects: list[Effect]  # of the cases
    nominal: Effect  # of the nominal run: its own values, and its agreement with the truth

    def runs(self) -> list[tuple[Case, Effect]]:
        """Cases with their effects; one at a time: the strongest factor first, the runs of a factor together."""
        order = range(len(self.cases))
        if self.design == "oat":
            rank = {name: number for number, (name, _) in enumerate(self.ranking())}
            order = sorted(order, key=lambda k: (rank[self.cases[k].values[0][0]], self.cases[k].values[0][1]))
        return [(self.cases[k], self.effects[k]) for k in order]

    def ranking(self) -> list[tuple[str, float]]:
        """Rank the factors by strength, the strongest first.

        One at a time, strength is the greatest relative L2 change of the forces; in a space-filling design, the
        fraction of the variance of that change.
        """
        if self.design == "oat":
            strength = {each.name: -1.0 for each in self.factors}
            for case, effect in zip(self.cases, self.effects, strict=True):
                (name, _), *_ = case.values
                if not math.isnan(effect.relative_l2):
                    strength[name] = max(strength[name], effect.relative_l2)
        else:
            index = self.main_effects()["relative_l2"].index
            strength = {each.name: float(part) for each, part in zip(self.factors, index, strict=True)}
        return sorted(strength.items(), key=lambda item: -item[1])

    def main_effects(self) -> dict[str, MainEffects]:
        """Main effects of a space-filling design, by result; failed runs are left out."""
        unit = np.array(
            [
                [each.to_unit(dict(case.values)[each.name]) for each in self.factors]
                for case, effect in zip(self.cases, self.effects, strict=True)
                if not effect.failure
            ]
        ).reshape(-1, len(self.factors))
        done = [effect for effect in self.effects if not effect.failure]
        if len(done) < 2 * len(self.factors) + 2:
            reason = next(effect.failure for effect in self.effects if effect.failure)
            raise InputError(
                "--samples", str(len(self.cases)), f"only {state_count(len(done), 'run')} succeeded: {reason}"
            )
        return {name: main_effects(unit, np.array([getattr(each, name) for each in done])) for name in RESULTS}

    def sentence(self) -> str:
        """Summarise the ranking for users."""
        labels = {each.name: each for each in self.factors}
        ranking = self.ranking()
        if self.design == "sobol":
            fractions = ", ".join(f"{name} {100.0 * fraction:.0f} %" for name, fraction in ranking[:3])
            explained = self.main_effects()["relative_l2"].explained
            summary = f"Largest main effects, of the variance of the change of the forces: {fractions}"
            summary += f"; all factors together {100.0 * explained:.0f} %"
            return summary + (", the rest are interactions." if explained < MIN_EXPLAINED else ".")
        strongest = {name: strength for name, strength in ranking if strength >= NEGLIGIBLE}
        weak = [name for name, strength in ranking if 0.0 <= strength < NEGLIGIBLE]
        parts = []
        for name in list(strongest)[:3]:
            case, effect = max(
                ((c, e) for c, e in zip(self.cases, self.effects, strict=True) if c.values[0][0] == name),
                key=lambda pair: -1.0 if math.isnan(pair[1].relative_l2) else pair[1].relative_l2,
            )
            label = labels[name].label(case.values[0][1])
            parts.append(f"{name} ({label} changes the forces by {100.0 * effect.relative_l2:.0f} %)")
        summary = f"Largest effects: {', then '.join(parts)}." if parts else "No varied factor has a large effect."
        return summary + (f" Below {100.0 * NEGLIGIBLE:.0f} %: {', '.join(weak)}." if weak else "")


def save_sensitivity(results: SensitivityResults, folder: Path) -> None:
    """Write a row per run as CSV and Parquet, and everything as JSON."""
    csv_file, json_file, parquet_file = (folder / name for name in FILES)
    columns = _columns(results)
    with replacing(csv_file) as part:
        write_table(part, {name: ["" if _absent(v) else v for v in values] for name, values in columns.items()})
    with replacing(parquet_file) as part:
        pq.write_table(pa.table({name: [_known(v) for v in values] for name, values in columns.items()}), part)
    write_atomically(json_file, (json.dumps(as_json(results), indent=1) + "\n").encode())


def as_json(results: SensitivityResults) -> dict[str, Any]:
    """Convert all results for JSON; null where there is no value."""
    factor = {each.name: each for each in results.factors}
    converted: dict[str, Any] = {
        "experiment": results.name,
        "design": results.design,
        "summary": results.sentence(),
        "nominal": _plain(results.nominal),
        "ranking": [
            {
                "factor": name,
                "strength": _known(strength) if strength >= 0 else None,
                "meaning": factor[name].meaning,
                "low": factor[name].low,
                "high": factor[name].high,
                "nominal": factor[name].nominal,
                "scale": factor[name].kind.value,
            }
            for name, strength in results.ranking()
        ],
        "runs": [{"values": dict(case.values), **_plain(effect)} for case, effect in results.runs()],
    }
    if results.design == "sobol":
        names = [each.name for each in results.factors]
        converted["main_effects"] = {
            result: {
                "index": dict(zip(names, effects.index.tolist(), strict=True)),
                "change": dict(zip(names, effects.change.tolist(), strict=True)),
                "explained": effects.explained,
            }
            for result, effects in results.main_effects().items()
        }
    return converted


def print_sensitivity(console: Console, results: SensitivityResults) -> None:
    """Print the table and the summary."""
    console.print(_effect_table(results) if results.design == "oat" else _design_table(results))
    failed = [each.failure for each in results.effects if each.failure]
    if failed:
        console.print(f"{state_count(len(failed), 'run')} failed: {failed[0]}", highlight=False, markup=False)
    console.print(results.sentence(), highlight=False, markup=False)


def _effect_table(results: SensitivityResults) -> Table:
    table = Table(title=f"{results.name}: one at a time, against the nominal run", box=None, pad_edge=False)
    names = [name for name in HEADINGS if not (name.startswith("true_") and math.isnan(results.nominal.true_r_fn))]
    table.add_column("factor", no_wrap=True)
    table.add_column("value", no_wrap=True)
    for name in names:
        table.add_column(HEADINGS[name], justify="right", no_wrap=True)
    table.add_row("nominal", "", *_cells(results.nominal, names))
    known = {each.name: each for each in results.factors}
    for case, effect in results.runs():
        (name, value), *_ = case.values
        table.add_row(name, known[name].label(value), *_cells(effect, names))
    return table


def _design_table(results: SensitivityResults) -> Table:
    title = f"{results.name}: {len(results.cases)} runs of a Sobol design; fraction of the variance, %"
    table = Table(title=title, box=None, pad_edge=False)
    table.add_column("factor", no_wrap=True)
    table.add_column("from", no_wrap=True)
    table.add_column("to", no_wrap=True)
    effects = results.main_effects()
    for name in RESULTS:
        table.add_column(HEADINGS[name], justify="right", no_wrap=True)
    number = {each.name: number for number, each in enumerate(results.factors)}
    for name, _ in results.ranking():
        factor = results.factors[number[name]]
        fractions = (f"{100.0 * effects[result].index[number[name]]:.0f}" for result in RESULTS)
        low, high = factor.ends
        table.add_row(name, factor.label(low), factor.label(high), *fractions)
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


def _columns(results: SensitivityResults) -> dict[str, list[Any]]:
    runs = results.runs()
    nominal = Case(())
    rows = [(nominal, results.nominal), *runs]
    columns: dict[str, list[Any]] = {}
    if results.design == "oat":
        columns["factor"] = [case.values[0][0] if case.values else "nominal" for case, _ in rows]
        columns["value"] = [case.values[0][1] if case.values else math.nan for case, _ in rows]
    else:
        for factor in results.factors:
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

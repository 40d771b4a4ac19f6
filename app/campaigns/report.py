"""The report of a campaign: a table of its runs, results over the varied parameters, and over the frames."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from ..process.atomic import write_atomically
from ..run_folder import SUMMARY
from .charts import draw_over_frames, draw_over_parameter, varied_parameters
from .collect import Row

REPORT = "report.html"
CURVES = {"friction_angle_degrees": "friction angle [°]", "trust": "trust"}
HIDDEN = ("experiment",)
HIDDEN_ENDINGS = ("_low", "_high", "_sd")  # intervals, which the charts show and catalogue.csv holds
INTERVALS = "wide bars: 10 to 90 % of its frames; thin lines: two standard deviations of the inferred forces"


def write_report(folder: Path, rows: Sequence[Row]) -> Path:
    """Write report.html into the campaign's folder; return its path."""
    import jinja2

    source = files(__name__.rpartition(".")[0]).joinpath("report.html").read_text(encoding="utf-8")
    template = jinja2.Environment(autoescape=True, trim_blocks=True).from_string(source)
    known = dict.fromkeys(name for row in rows for name, value in row.items() if value not in ("", None))
    columns = [name for name in known if name not in HIDDEN and not name.endswith(HIDDEN_ENDINGS)]
    done = [str(row["run"]) for row in rows if row["state"] == "done"]
    finished = [row for row in rows if row["state"] == "done"]
    settings = [name for name in columns if "." in name]  # keys of experiment.toml
    charts = [
        {
            "svg": draw_over_parameter(key, values, finished),
            "caption": f"Every run over {key}: mean of its frames; {INTERVALS}",
        }
        for key, values in varied_parameters(finished, settings).items()
    ]
    charts += [
        {"svg": draw_over_frames({name: _curve(folder / name, key) for name in done}, meaning),
         "caption": f"{meaning} over frames"}
        for key, meaning in CURVES.items()
        if done
    ]  # fmt: skip
    failed = sum(row["state"] == "failed" for row in rows)
    page = template.render(
        title=f"Campaign {folder.name}",
        rows=rows,
        columns=columns,
        charts=charts,
        failed=failed,
        folder=folder.as_posix(),
    )
    write_atomically(folder / REPORT, page.encode())
    return folder / REPORT


def _curve(run: Path, key: str) -> list[float | None]:
    """Return a value of every frame except the first, which has no preceding motion."""
    values = json.loads((run / SUMMARY).read_text(encoding="utf-8"))[key]
    return [None, *values[1:]]

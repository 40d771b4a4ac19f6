"""python -m tests.app.manual.renew_pictures: run the sample, and draw the manual's pictures.

Those of OVITO and of ParaView are drawn by tests.app.manual.other_programs.
"""

from __future__ import annotations

import tempfile
from contextlib import chdir
from pathlib import Path

from PIL import Image
from rodsight.cli.main import main

from tests.app.manual.page_pictures import draw_page, draw_report
from tests.program import ROOT

TABS = ("Summary", "Forces", "Convergence", "Contacts", "Statistics", "Truth")
FIGURES = ("forces", "density", "rose", "truth", "difference")
FRAME, QUALITY = 11, 90


def renew(target: Path = ROOT / "app/docs/pictures") -> None:
    """Write every picture anew."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        _rodsight("run", ROOT / "sample_data/shear", "--out", run, "--quiet")
        for tab in TABS:
            drawn = Path(folder) / tab
            _rodsight(
                "export", "pictures", run, "--tab", tab, "--frames", f"{FRAME}:{FRAME + 1}", "--size", "1440x900",
                "--out", drawn,
            )  # fmt: skip
            (picture,) = drawn.glob("*.png")
            Image.open(picture).convert("RGB").save(target / f"{tab.lower()}.jpg", quality=QUALITY)
        figures = Path(folder) / "figures"
        _rodsight("export", "figures", run, "--frame", FRAME, "--formats", "png", "--out", figures)
        for name in FIGURES:
            (file,) = figures.glob(f"{name}*.png")
            (target / f"figure_{name}.png").write_bytes(file.read_bytes())
        with chdir(folder):
            _rodsight("campaign", ROOT / "sample_data/campaign.csv", "--out", "friction", "--quiet")
        draw_report(Path(folder) / "friction/report.html", target / "campaign.png")
        draw_page(Path(folder) / "page", target, _rodsight)


def _rodsight(*arguments: object) -> None:
    try:
        main([str(each) for each in arguments])
    except SystemExit as end:
        if end.code:
            raise


if __name__ == "__main__":
    renew()

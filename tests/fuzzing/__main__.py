"""Print the counts of the last full run and write the page; or run a part of the corrupted inputs.

python -m tests.fuzzing                         the table
python -m tests.fuzzing --pieces FILE 0 2       the first of two parts of the campaign, stored in FILE, which is resumed
python -m tests.fuzzing --long 1000             the memory of a run with this number of photographs
python -m tests.fuzzing --peak 100 1000         the greatest memory of whole commands, and its growth
python -m tests.fuzzing --gather FILE FILE      count the pieces of all parts
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from .campaign import gather, run_pieces
from .cases import make_originals
from .long_runs import measure
from .peak_memory import peaks_of
from .table import PAGE, note, render

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.fuzzing", description=__doc__)
    parser.add_argument("--pieces", nargs=3, metavar=("FILE", "PART", "PARTS"))
    parser.add_argument("--gather", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--long", type=int, metavar="FRAMES")
    parser.add_argument("--peak", type=int, nargs="+", metavar="FRAMES")
    options = parser.parse_args()
    if options.pieces:
        file, part, parts = options.pieces
        with tempfile.TemporaryDirectory() as folder:
            run_pieces(make_originals(Path(folder)), Path(file), int(part), int(parts))
    elif options.peak:
        with tempfile.TemporaryDirectory() as folder:
            peaks_of(options.peak, Path(folder))
    elif options.long:
        with tempfile.TemporaryDirectory() as folder:
            measure(make_originals(Path(folder)).tracked, Path(folder), options.long)
    else:
        if options.gather:
            tried, problems = gather(options.gather)
            note("mutations", tried=tried, wrong=len(problems))
            print(*problems, sep="\n")
        PAGE.write_text(render(), encoding="utf-8")
        print(render())

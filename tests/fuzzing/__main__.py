"""Print what the last full run counted, and write the page; or try a share of the spoiled inputs.

python -m tests.fuzzing                         the table
python -m tests.fuzzing --pieces FILE 0 2       the first of two shares of the campaign, kept in FILE; it goes on there
python -m tests.fuzzing --long 1000             the memory of a run of so many photographs
python -m tests.fuzzing --gather FILE FILE      count the pieces of all shares
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from .campaign import gather, try_pieces
from .cases import make_originals
from .long_runs import measure
from .table import PAGE, note, render

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.fuzzing", description=__doc__)
    parser.add_argument("--pieces", nargs=3, metavar=("FILE", "PART", "PARTS"))
    parser.add_argument("--gather", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--long", type=int, metavar="FRAMES")
    asked = parser.parse_args()
    if asked.pieces:
        file, part, parts = asked.pieces
        with tempfile.TemporaryDirectory() as folder:
            try_pieces(make_originals(Path(folder)), Path(file), int(part), int(parts))
    elif asked.long:
        with tempfile.TemporaryDirectory() as folder:
            measure(make_originals(Path(folder)).tracked, Path(folder), asked.long)
    else:
        if asked.gather:
            tried, wrong = gather(asked.gather)
            note("mutations", tried=tried, wrong=len(wrong))
            print(*wrong, sep="\n")
        PAGE.write_text(render(), encoding="utf-8")
        print(render())

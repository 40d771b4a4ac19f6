"""python -m tests.mutation: try all mutants and store the table; --last prints the stored one."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.mutation.run import MAX_SURVIVAL, ROOT, format_table, judge_mutants, survival
from tests.mutation.table import MUTANTS

LAST_TABLE = Path(__file__).with_name("last_table.md")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--last", action="store_true", help="only print the table of the last complete run")
    parser.add_argument("--check", action="store_true", help="only check that every mutant's text is found once")
    parser.add_argument("--room", default="", help="only mutants of rooms that begin so, like solver/nlgs; not stored")
    options = parser.parse_args()
    if options.last:
        print(LAST_TABLE.read_text(encoding="utf-8"), end="")
        return 0
    mutants = [mutant for mutant in MUTANTS if mutant.room.startswith(options.room)]
    if options.check:
        for mutant in mutants:
            mutant.locate(ROOT)
        print(f"{len(mutants)} mutants, each found once")
        return 0
    verdicts = []
    with tempfile.TemporaryDirectory() as folder:
        for verdict in judge_mutants(mutants, Path(folder)):
            verdicts.append(verdict)
            outcome = f"killed by {verdict.by}" if verdict.killed else f"SURVIVED: {verdict.mutant.old!r}"
            print(f"{len(verdicts)}/{len(mutants)} {verdict.file} {verdict.seconds:.0f} s {outcome}", flush=True)
    table = format_table(verdicts)
    print(table)
    if not options.room:
        LAST_TABLE.write_text(table, encoding="utf-8")
    return int(survival(verdicts) > MAX_SURVIVAL)


if __name__ == "__main__":
    sys.exit(main())

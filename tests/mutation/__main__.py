"""python -m tests.mutation: try all mutants and store the table; --last prints the stored one."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from tests.mutation.mutant import Mutant
from tests.mutation.run import MAX_SURVIVAL, ROOT, Verdict, format_table, judge_mutants, survival
from tests.mutation.table import MUTANTS

LAST_TABLE = Path(__file__).with_name("last_table.md")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--last", action="store_true", help="only print the stored table")
    parser.add_argument("--check", action="store_true", help="only check that every mutant's text is found once")
    parser.add_argument("--room", default="", help="only mutants of rooms that begin so, like solver/nlgs; not stored")
    parser.add_argument("--record", type=Path, help="file of verdicts: mutants in it are not tried again, others added")
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
    known = read_verdicts(options.record)
    verdicts = [known[mutant] for mutant in mutants if mutant in known]
    left = [mutant for mutant in mutants if mutant not in known]
    with tempfile.TemporaryDirectory() as folder:
        for verdict in judge_mutants(left, Path(folder)):
            verdicts.append(verdict)
            note_verdict(options.record, verdict)
            outcome = f"killed by {verdict.by}" if verdict.killed else f"SURVIVED: {verdict.mutant.old!r}"
            print(f"{len(verdicts)}/{len(mutants)} {verdict.file} {verdict.seconds:.0f} s {outcome}", flush=True)
    table = format_table(verdicts)
    print(table)
    if not options.room:
        LAST_TABLE.write_text(table, encoding="utf-8")
    return int(survival(verdicts) > MAX_SURVIVAL)


def read_verdicts(record: Path | None) -> dict[Mutant, Verdict]:
    """Read the verdicts of former runs; none without a file."""
    if record is None or not record.exists():
        return {}
    lines = map(json.loads, record.read_text(encoding="utf-8").splitlines())
    found = (Verdict(Mutant(*each[:3], tuple(each[3])), Path(each[4]), *each[5:]) for each in lines)
    return {verdict.mutant: verdict for verdict in found}


def note_verdict(record: Path | None, verdict: Verdict) -> None:
    """Add a verdict to a file."""
    if record is not None:
        mutant = verdict.mutant
        line = [mutant.place, mutant.old, mutant.new, mutant.tests]
        line += [str(verdict.file), verdict.killed, verdict.by, verdict.seconds]
        with record.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    sys.exit(main())

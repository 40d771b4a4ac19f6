"""The log of verdicts: appended, never rewritten, safe against several tabs, programs and crashes."""

import json
import multiprocessing
import threading

import pytest
from rodsight.process.errors import InputError
from rodsight.process.frame_range import FrameRange
from rodsight.verdicts.decisions import BodyNames, decide
from rodsight.verdicts.log import Entry, Flag, Origin, Verdict, VerdictLog, fingerprint
from rodsight.verdicts.table import export_verdicts, import_verdicts

BODIES = BodyNames((1, 2, 3, 7), ("top", "12"))


def contact(frame=0, a=1, b=2, reviewer="anna", verdict=Verdict.CONTACT, **more):
    return Entry(frame, reviewer, a, b, verdict, **more)


@pytest.fixture
def log(tmp_path):
    return VerdictLog(tmp_path / "verdicts.jsonl")


def test_a_line_holds_the_whole_verdict(log):
    log.append(contact(frame=4, b="top", seconds=1.25, origin=Origin.CLICK, blind=True))
    line = json.loads(log.file.read_text())
    assert (line["frame"], line["a"], line["b"], line["verdict"]) == (4, 1, "top", "contact")
    assert (line["reviewer"], line["seconds"], line["origin"], line["blind"]) == ("anna", 1.25, "click", True)
    assert line["time"].endswith("+00:00")
    assert {"version", "line"} <= set(line)


def test_lines_are_only_appended(log):
    log.append(contact())
    before = log.file.read_bytes()
    log.append(contact(verdict=Verdict.NO_CONTACT))
    log.undo("anna")
    log.append(Entry(0, "anna", flag=Flag.RESET))
    assert log.file.read_bytes().startswith(before)
    assert len(log.file.read_text().splitlines()) == 4


def test_the_latest_verdict_counts_in_either_order_of_the_pair(log):
    log.append(contact(a=1, b=2))
    log.append(contact(a=2, b=1, verdict=Verdict.NO_CONTACT))
    (entry,) = log.latest_entries()
    assert entry.verdict is Verdict.NO_CONTACT


def test_verdicts_stay_with_their_photographs(log):
    names = ["a", "b", "c", "d"]
    for frame in range(4):
        log.append(contact(frame=frame))
    log.append(Entry(2, "anna", flag=Flag.RESET))
    log.reorder(names, ["a", "d", "b"])  # c is left out
    assert sorted(pair[0] for pair, _ in log.verdicts()) == [0, 1, 2]
    assert [entry.flag for entry in log.entries() if entry.flag] == []
    log.append(contact(frame=1, a=3, b=7))  # on d, as it is numbered now
    log.reorder(["a", "d", "b"], names)
    assert sorted((pair[0], pair[1]) for pair, _ in log.snapshot().verdicts()) == [
        (0, 1),
        (1, 1),
        (2, 1),
        (3, 1),
        (3, 3),
    ]
    assert [entry.frame for entry in VerdictLog(log.file).entries() if entry.flag] == [2]


def test_undo_reverts_one_line_of_its_own_reviewer(log):
    log.append(contact())
    log.append(contact(verdict=Verdict.UNSURE))
    log.append(contact(reviewer="ben"))
    assert log.undo("anna").verdict is Verdict.UNSURE
    assert log.undo("anna").verdict is Verdict.CONTACT
    assert log.undo("anna") is None
    assert [entry.reviewer for entry in log.entries()] == ["ben"]


def test_lines_of_another_tab_appear_at_the_next_access(log):
    other = VerdictLog(log.file)
    log.append(contact())
    assert len(other.entries()) == 1
    other.append(contact(b=3))
    assert len(log.entries()) == 2


@pytest.mark.parametrize("fragment", [b'{"frame": 1, "a": 1, "b"', b"\x00\x00\x00", "{“".encode()[:3]])
def test_a_line_cut_by_a_crash_loses_no_other_line(log, fragment):
    log.append(contact())
    with log.file.open("ab") as stream:
        stream.write(fragment)
    fresh = VerdictLog(log.file)
    assert len(fresh.entries()) == 1
    fresh.append(contact(b=3))
    assert [entry.b for entry in VerdictLog(log.file).entries()] == [2, 3]
    assert fresh.damaged_lines == 1


def _write_many(file, name):
    log = VerdictLog(file)
    for number in range(40):
        log.append(contact(frame=number, reviewer=name))


@pytest.mark.thorough
def test_programs_that_write_at_the_same_time_do_not_mix_lines(log):
    start = multiprocessing.get_context("spawn")
    writers = [start.Process(target=_write_many, args=(log.file, f"reviewer {n}")) for n in range(3)]
    for writer in writers:
        writer.start()
    threads = [threading.Thread(target=_write_many, args=(log.file, f"tab {n}")) for n in range(3)]
    for thread in threads:
        thread.start()
    for each in [*writers, *threads]:
        each.join()
    assert len(log.entries()) == 6 * 40
    assert log.damaged_lines == 0


@pytest.mark.parametrize(
    ("change", "named"),
    [({"verdict": "perhaps"}, "perhaps"), ({"frame": "x"}, "frame"), ({"b": None}, "b = None"), ({"a": True}, "a = ")],
)
def test_a_wrong_value_is_named_with_its_line(log, change, named):
    log.append(contact())
    line = json.loads(log.file.read_text()) | change
    with log.file.open("a") as stream:
        stream.write(json.dumps(line) + "\n")
    with pytest.raises(InputError, match="line 2") as raised:
        VerdictLog(log.file).entries()
    assert named in str(raised.value)


def test_the_majority_decides_and_a_tie_does_not(log):
    for reviewer, verdict in (("anna", "contact"), ("ben", "contact"), ("cleo", "no contact")):
        log.append(contact(reviewer=reviewer, verdict=Verdict(verdict)))
    log.append(contact(b=3, reviewer="anna"))
    log.append(contact(b=3, reviewer="ben", verdict=Verdict.NO_CONTACT))
    log.append(contact(b="top", verdict=Verdict.UNSURE))
    log.append(contact(b=7, verdict=Verdict.NO_CONTACT))
    found = decide(log, BODIES, frames=FrameRange(0), frame_count=1)
    assert found.contact == {(0, BODIES.key(0, 1))}
    assert found.no_contact == {(0, BODIES.key(0, 3))}
    assert found.disputed == {(0, BODIES.key(0, 2)), (0, BODIES.key(0, 4))}


def test_frames_count_from_the_first_of_the_run(log):
    log.append(contact(frame=7))
    found = decide(log, BODIES, frames=FrameRange(5), frame_count=3)
    assert found.contact == {(2, BODIES.key(0, 1))}
    assert decide(log, BODIES, frames=FrameRange(8), frame_count=3).unknown == 1


def test_the_fingerprint_depends_on_the_latest_verdicts_only(log):
    assert fingerprint(log) == ""
    log.append(contact(b=3, verdict=Verdict.UNSURE))
    assert fingerprint(log) == ""
    log.append(contact())
    first = fingerprint(log)
    log.append(contact(verdict=Verdict.NO_CONTACT))
    assert fingerprint(log) != first
    log.undo("anna")
    assert fingerprint(log) == first


def test_exported_verdicts_import_unchanged(log, tmp_path):
    log.append(contact(frame=1, a=3, b="12", verdict=Verdict.NO_CONTACT, seconds=2.5))
    log.append(contact(frame=0, a=7, b=2))
    assert export_verdicts(log, tmp_path / "out.csv") == 2
    again = VerdictLog(tmp_path / "again.jsonl")
    assert len(import_verdicts(again, tmp_path / "out.csv", BODIES, "x", frames=range(2))) == 2
    before = {(e.subject, e.verdict, e.reviewer, e.seconds, e.time) for e in log.latest_entries()}
    assert {(e.subject, e.verdict, e.reviewer, e.seconds, e.time) for e in again.latest_entries()} == before


def test_a_complete_list_of_contacts_rejects_all_other_candidates(log, tmp_path):
    file = tmp_path / "list.csv"
    file.write_text("frame,i,j\n0,2,1\n0,3,top\n")
    pairs = {0: [(0, 1), (1, 2), (2, 4)], 1: [(0, 1)]}
    assert len(import_verdicts(log, file, BODIES, "ben", frames=range(2), candidates=pairs)) == 3
    verdicts = {entry.subject[1:]: entry.verdict for entry in log.latest_entries()}
    assert verdicts == {(1, 2): Verdict.CONTACT, (3, "top"): Verdict.CONTACT, (2, 3): Verdict.NO_CONTACT}


@pytest.mark.parametrize(
    ("row", "named"),
    [
        ("0,1,99", "j = '99'"),
        ("9,1,2", "frame = '9'"),
        ("0,1,1", "itself"),
        ("0,1,left", "j = 'left'"),
        ("0,x,1", "i ="),
    ],
)
def test_a_wrong_row_is_named_and_nothing_is_written(log, tmp_path, row, named):
    file = tmp_path / "list.csv"
    file.write_text(f"frame,i,j\n0,2,1\n{row}\n")
    with pytest.raises(InputError, match="row 3") as raised:
        import_verdicts(log, file, BODIES, "ben", frames=range(2))
    assert named in str(raised.value)
    assert not log.file.exists()


def test_a_contact_of_bodies_that_are_far_apart_is_refused(log, tmp_path):
    file = tmp_path / "list.csv"
    file.write_text("frame,i,j,verdict\n5,2,1,contact\n5,1,3,no contact\n5,1,12,contact\n")

    def gap(frame: int, i: int, j: int) -> float:
        assert frame == 0
        return 0.1 if {i, j} == {0, 1} else 25.0

    with pytest.raises(InputError, match=r"row 4.*12.*is no contact of 1: their surfaces are 25 radii apart"):
        import_verdicts(log, file, BODIES, "ben", frames=range(5, 7), gap=gap)
    assert not log.file.exists()
    file.write_text("frame,i,j,verdict\n5,2,1,contact\n5,1,3,no contact\n")
    assert len(import_verdicts(log, file, BODIES, "ben", frames=range(5, 7), gap=gap)) == 2

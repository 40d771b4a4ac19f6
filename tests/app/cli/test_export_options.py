"""`rodsight export` refuses options that do not apply to the chosen kind."""

from __future__ import annotations

import pytest
from rodsight.cli.main import main
from rodsight.results.hdf5.store import Provenance, save_results

from tests.app.recording.fake_results import make_results


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    save_results(folder / "results.h5", make_results(frame_count=2), Provenance("", "experiment.toml", (0, None), {}))
    return folder


@pytest.mark.parametrize(
    ("kind", "option", "value"),
    [
        ("tables", "--frame", "1"), ("tables", "--frames", "0:1"), ("vtk", "--kind", "csv"), ("ovito", "--step", "2"),
        ("graph", "--rate", "6"), ("figures", "--frames", "0:1"), ("video", "--frame", "1"),
        ("dic", "--formats", "pdf"),
        ("tables", "--pixel-size", "1e-4"), ("pictures", "--rate", "6"), ("tables", "--width", "single"),
        ("figures", "--timeline", "frame"), ("vtk", "--size", "800x600"), ("vtk", "--tab", "Forces"),
        ("figures", "--view", "Forces"),
    ],
)  # fmt: skip
def test_an_option_of_another_kind_is_refused_by_name(run, kind, option, value, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main(["export", kind, str(run), "--out", str(tmp_path / "out"), option, value])
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"export: {option} with {kind}: applies to " in line
    assert not (tmp_path / "out").exists()


def test_options_of_the_chosen_kind_are_used(run, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main(["export", "tables", str(run), "--out", str(tmp_path), "--kind", "parquet"])
    assert not end.value.code
    assert (tmp_path / "contacts.parquet").is_file()
    assert str(tmp_path) in capsys.readouterr().out


@pytest.mark.thorough
@pytest.mark.parametrize(("frames", "named"), [("0:1", "/: rose_000000.png."), (None, "/: 2 pictures, rose_000000")])
def test_the_pictures_that_were_written_are_named(run, frames, named, tmp_path, capsys):
    (run / "recording.rrd").touch()  # figures are drawn from the results
    part = () if frames is None else ("--frames", frames)
    with pytest.raises(SystemExit) as end:
        main(["export", "pictures", str(run), "--out", str(tmp_path), "--figure", "rose", *part])
    assert not end.value.code
    assert named in capsys.readouterr().out

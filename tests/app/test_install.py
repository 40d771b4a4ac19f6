"""The installed package, editable and from the wheel, beside a user's own programs."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from rodsight.process.machine.processor import processor_level

from tests.first_run import build_wheel, run_first, unpack_wheel

pytestmark = pytest.mark.screen  # a wheel is built, and processes are started

TREE = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel with kernels for this processor, unpacked."""
    folder = tmp_path_factory.mktemp("wheel")
    level = processor_level()
    if level is None:
        pytest.skip("wheels have kernels for x86-64-v3 and v4 only")
    return unpack_wheel(build_wheel(folder, level), folder / "site")


def run(code: str, folder: Path, *paths: Path) -> subprocess.CompletedProcess[str]:
    """Run Python code in a folder, with these paths searched before what is installed."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}
    return subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)


@pytest.fixture
def notebook_folder(tmp_path: Path) -> Path:
    """A working folder of a user with programs called app.py and solver.py."""
    for name in ("app", "solver"):
        (tmp_path / f"{name}.py").write_text(f'print("the user\'s own {name}")\n')
    return tmp_path


OURS = "import rodsight, rodsight.pipeline, rodsight.solver.nlgs.solve, rodsight.cli.main"
THEIRS = "import app, solver"
FOLDERS = (
    "from pathlib import Path;"
    "print(*(Path(each.__file__).resolve().parent for each in (rodsight, rodsight.solver)), sep='\\n')"
)
ORDERS = pytest.mark.parametrize("order", [(OURS, THEIRS), (THEIRS, OURS)], ids=["ours first", "theirs first"])


def import_both(order: tuple[str, str], folder: Path, *paths: Path) -> set[str]:
    """Return the lines printed by a program that imports rodsight and the user's own app.py and solver.py."""
    process = run(";".join((*order, FOLDERS)), folder, *paths)
    assert process.returncode == 0, process.stderr
    return set(process.stdout.splitlines())


@ORDERS
def test_an_editable_install_works_beside_an_app_and_a_solver_of_the_users(notebook_folder, order):
    lines = import_both(order, notebook_folder, TREE / ".editable")
    assert lines == {"the user's own app", "the user's own solver", str(TREE / "app"), str(TREE / "solver")}


@ORDERS
def test_the_wheel_works_beside_an_app_and_a_solver_of_the_users(notebook_folder, wheel, order):
    lines = import_both(order, notebook_folder, wheel)
    installed = wheel / "rodsight"
    assert lines == {"the user's own app", "the user's own solver", str(installed), str(installed / "solver")}


def test_the_wheel_holds_the_package_its_data_and_no_tests(wheel):
    assert [each.name for each in wheel.iterdir() if not each.name.endswith(".dist-info")] == ["rodsight"]
    for name in (
        "py.typed", "workbench/page/steps/review.js", "recording/viewing/pages/single_page.html",
        "docs/troubleshooting.md", "docs/pictures/forces.jpg", "docs/notebooks/is_it_to_be_trusted.ipynb",
        "manual/page.html", "manual/cures.toml", "campaigns/report.html",
    ):  # fmt: skip
        assert (wheel / "rodsight" / name).is_file(), name
    assert (wheel / "rodsight" / "solver" / "py.typed").is_file()


@pytest.mark.slow
def test_the_first_run_of_the_wheel_compiles_nothing(wheel, tmp_path):
    assert run_first(wheel, tmp_path).compilations == 0
    (archive,) = (wheel / "rodsight/shipped_kernels").iterdir()
    with zipfile.ZipFile(archive) as content:
        brought = sum(name.endswith(".nbc") for name in content.namelist())
    assert len(list(tmp_path.rglob("*.nbc"))) == brought  # nor does any process that the run starts
    assert list(tmp_path.rglob("compiled-*")) == []  # which none does


def test_a_wheel_without_kernels_fits_every_system_and_one_with_kernels_its_own(wheel):
    (facts,) = wheel.glob("*.dist-info/WHEEL")
    tags = [line for line in facts.read_text().splitlines() if line.startswith("Tag: ")]
    assert tags
    assert all(tag.startswith(f"Tag: cp{sys.version_info.major}{sys.version_info.minor}-none-") for tag in tags)
    assert not any(tag.endswith("-any") for tag in tags)

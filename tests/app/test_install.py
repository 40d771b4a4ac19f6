"""The package as users have it: in an editable install and in the wheel, beside programs of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.screen  # a wheel is built, and processes are started

TREE = Path(__file__).parents[2]
OWN = 'print("the user\'s own")\n'


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, unpacked."""
    folder = tmp_path_factory.mktemp("wheel")
    build = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(folder))
    subprocess.run([*build, str(TREE)], check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    zipfile.ZipFile(file).extractall(folder / "site")
    return folder / "site"


def run(code: str, folder: Path, *paths: Path) -> subprocess.CompletedProcess[str]:
    """Run Python code in a folder, with these paths searched before what is installed."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}
    return subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)


@pytest.fixture
def notebook_folder(tmp_path: Path) -> Path:
    """Where somebody works who has programs called app.py and solver.py."""
    for name in ("app.py", "solver.py"):
        (tmp_path / name).write_text(OWN)
    return tmp_path


USE = (
    "import rodsight, rodsight.pipeline, rodsight.cli.main; from pathlib import Path;"
    "print(Path(rodsight.__file__).resolve().parent); import app"
)


def test_an_editable_install_works_beside_an_app_and_a_solver_of_the_users(notebook_folder):
    told = run(USE, notebook_folder, TREE / ".editable", TREE)
    assert told.returncode == 0, told.stderr
    assert told.stdout.splitlines() == [str(TREE / "app"), "the user's own"]


def test_the_wheel_works_beside_an_app_and_a_solver_of_the_users(notebook_folder, wheel):
    told = run(USE, notebook_folder, wheel)
    assert told.returncode == 0, told.stderr
    assert told.stdout.splitlines() == [str(wheel / "rodsight"), "the user's own"]


def test_the_wheel_holds_the_package_its_data_and_no_tests(wheel):
    assert sorted(each.name for each in wheel.iterdir() if not each.name.endswith(".dist-info")) == [
        "rodsight",
        "solver",
    ]
    for name in (
        "py.typed", "review/page/index.html", "recording/viewing/single_page.html", "docs/troubleshooting.md",
        "docs/pictures/experiment.png", "docs/notebooks/is_it_to_be_trusted.ipynb", "manual/page.html",
        "manual/cures.toml", "campaign/report.html",
    ):  # fmt: skip
        assert (wheel / "rodsight" / name).is_file(), name
    assert (wheel / "solver" / "py.typed").is_file()


def test_another_module_called_solver_is_named_and_not_used(notebook_folder):
    told = run("import solver, rodsight", notebook_folder, TREE / ".editable", TREE)
    assert told.returncode == 1
    assert "another module is loaded as 'solver'" in told.stderr

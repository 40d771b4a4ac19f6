"""A workbench on a folder of photographs, requested without a network."""

import shutil
from pathlib import Path

import pytest
from rodsight.recording.viewing.gate import Gate
from rodsight.workbench.service.server import make_application
from rodsight.workbench.service.workbench import Workbench
from rodsight.workbench.setup.draft import Draft
from starlette.testclient import TestClient

from tests.app.workbench.spoiled_tracks import spoil
from tests.golden.stored import unpack

SCALED = {
    "name": "mine", "photographs.files": "pictures/*.jpg", "photographs.interval": 30.0,
    "photographs.pixel_size": 2.5e-4,
}  # fmt: skip
PORT = 4711
HOST = f"http://127.0.0.1:{PORT}"


class Visitor:
    """The page's half of the conversation."""

    def __init__(self, workbench: Workbench) -> None:
        self.workbench, self.gate = workbench, Gate(PORT, "open")
        self.client = TestClient(make_application(workbench, self.gate), base_url=HOST, follow_redirects=False)

    def enter(self) -> "Visitor":
        assert self.client.get("/", params={"token": self.gate.token}).status_code == 303
        return self

    def post(self, endpoint: str, values: dict, **headers: str):
        return self.client.post(f"/api/{endpoint}", json=values, headers={"Origin": HOST, **headers})

    def request(self, endpoint: str, **values):
        answer = self.post(endpoint, values)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def refused(self, endpoint: str, **values) -> str:
        answer = self.post(endpoint, values)
        assert answer.status_code == 422, (answer.status_code, answer.text)
        return answer.text


@pytest.fixture
def photographs_only(made_photographs: Path, tmp_path: Path) -> Path:
    """A folder in which somebody has put photographs, and nothing else."""
    folder = tmp_path / "my photographs" / "pictures"
    folder.mkdir(parents=True)
    for k, file in enumerate(sorted((made_photographs / "photos").iterdir())):
        shutil.copy(file, folder / f"DSC_{7 + 4 * k}{file.suffix}")
    return tmp_path


@pytest.fixture
def solved(photographs_only: Path) -> Path:
    """A folder with an experiment of photographs and the results of an earlier version."""
    Draft(photographs_only / "my photographs").set_keys("all", SCALED)
    run = photographs_only / "runs" / "mine"
    run.mkdir(parents=True)
    unpack(2, run)
    return photographs_only


@pytest.fixture
def begun(made_photographs: Path, photographs_only: Path) -> Path:
    """A folder with an experiment whose rods are known."""
    folder = photographs_only / "my photographs"
    (folder / "grains.csv").write_bytes((made_photographs / "grains.csv").read_bytes())
    Draft(folder).set_keys("all", SCALED | {"photographs.grains": "grains.csv"})
    return photographs_only


@pytest.fixture
def visitor(photographs_only: Path) -> Visitor:
    return Visitor(Workbench(photographs_only)).enter()


@pytest.fixture(scope="session")
def spoiled_once(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an experiment, mine, and its spoiled tracks; not to be written to."""
    root = tmp_path_factory.mktemp("spoiled")
    shutil.copytree(made_photographs, root / "mine")
    spoil(root)
    return root


@pytest.fixture
def spoiled(spoiled_once: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may change."""
    return Path(shutil.copytree(spoiled_once, tmp_path, dirs_exist_ok=True))

"""A workbench on a folder of photographs, asked without a network."""

import shutil
from pathlib import Path

import pytest
from rodsight.recording.viewing.gate import Gate
from rodsight.workbench.service.bench import Bench
from rodsight.workbench.service.server import make_application
from starlette.testclient import TestClient

PORT = 4711
HOST = f"http://127.0.0.1:{PORT}"


class Visitor:
    """The page's half of the conversation."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.gate = bench, Gate(PORT, "open")
        self.client = TestClient(make_application(bench, self.gate), base_url=HOST, follow_redirects=False)

    def enter(self) -> "Visitor":
        assert self.client.get("/", params={"token": self.gate.token}).status_code == 303
        return self

    def post(self, question: str, values: dict, **headers: str):
        return self.client.post(f"/ask/{question}", json=values, headers={"Origin": HOST, **headers})

    def ask(self, question: str, **values):
        answer = self.post(question, values)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def refused(self, question: str, **values) -> str:
        answer = self.post(question, values)
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
def visitor(photographs_only: Path) -> Visitor:
    return Visitor(Bench(photographs_only)).enter()

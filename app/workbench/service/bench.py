"""Everything that is open in the workbench."""

from __future__ import annotations

import secrets
import threading
from pathlib import Path
from typing import Any

from ... import __version__
from ...errors import InputError
from ...experiment.experiment import CONFIG_NAME
from ...experiment.photographs import read_photograph
from ..setup import edits
from ..setup.draft import Draft
from ..setup.folder import as_name, copy_sample, find_experiments, find_rolls, home_of, sample_folder
from .project import Project, as_jpeg


class Bench:
    """The folder that the workbench was opened on, and its experiments."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self.key = secrets.token_urlsafe(32)  # in the address of a recording, which the page alone is told
        self._projects: dict[str, Project] = {}
        self._lock = threading.Lock()
        self.closed = False
        self.reviewer = ""  # who judged last

    def project(self, at: str) -> Project:
        """An experiment by its path from the root. Raises InputError for what is none, or lies elsewhere."""
        folder = (self.root / at).resolve()
        if not folder.is_relative_to(self.root) or not (folder / CONFIG_NAME).is_file():
            raise InputError(at, "", f"is no experiment below {self.root}")
        key = folder.relative_to(self.root).as_posix()
        with self._lock:
            if key not in self._projects:
                self._projects[key] = Project(self.root, folder)
            return self._projects[key]

    def close(self) -> None:
        """Pause every run: the same command goes on with it."""
        self.closed = True
        for project in list(self._projects.values()):
            project.close()

    def home(self) -> dict[str, Any]:
        """The first page: experiments, photographs that belong to none, the sample."""
        experiments = [self.project(folder.relative_to(self.root).as_posix()) for folder in find_experiments(self.root)]
        rolls = []
        for number, roll in enumerate(find_rolls(self.root)):
            home, pattern, name = home_of(roll, self.root)
            rolls.append({
                "roll": number, "folder": roll.folder.relative_to(self.root).as_posix(), "count": len(roll.files),
                "first": roll.files[0].name, "last": roll.files[-1].name, "name": name, "pattern": pattern,
                "home": home.relative_to(self.root).as_posix(),
            })  # fmt: skip
        return {
            "root": str(self.root), "version": __version__, "rolls": rolls,
            "experiments": [project.glance() for project in experiments],
            "sample": sample_folder() is not None and not any(each.folder.name == "shear" for each in experiments),
        }  # fmt: skip

    def glimpse(self, roll: int | None, widest: int) -> bytes:
        """The first of some photographs, as JPEG; None: of the sample."""
        files: list[Path] = []
        if roll is None:
            folder = sample_folder()
            files += [] if folder is None else sorted((folder / "photos").iterdir())[:1]
        else:
            rolls = find_rolls(self.root)
            files += rolls[roll].files[:1] if 0 <= roll < len(rolls) else ()
        if not files:
            raise InputError(self.root, "photographs", "are not there any more")
        return as_jpeg(read_photograph(files[0]), widest)

    def begin(self, roll: int, name: str) -> Project:
        """Make an experiment of photographs."""
        rolls = find_rolls(self.root)
        if not 0 <= roll < len(rolls):
            raise InputError(self.root, f"photographs {roll}", "are not there any more")
        home, pattern, _ = home_of(rolls[roll], self.root)
        edits.begin(Draft(home), as_name(name), pattern)
        return self.project(home.relative_to(self.root).as_posix())

    def sample(self) -> Project:
        """The sample, copied into the folder."""
        return self.project(copy_sample(self.root).relative_to(self.root).as_posix())

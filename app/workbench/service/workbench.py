"""The folder that the workbench was opened on, and its experiments."""

from __future__ import annotations

import secrets
import threading
from pathlib import Path
from typing import Any

from ... import __version__
from ...experiment.experiment import CONFIG_NAME
from ...experiment.pictures.picture_file import read_photograph
from ...process.errors import InputError
from ..inspecting.photograph_store import encode_jpeg
from ..setup import edits
from ..setup.draft import Draft
from ..setup.experiment_folders import (
    copy_sample,
    duplicate,
    experiment_place,
    find_experiments,
    find_image_series,
    find_series,
    sample_folder,
    take_over,
    valid_name,
)
from .project import Project


class Workbench:
    """The experiments of one folder."""

    def __init__(self, root: Path, *, run: Path | None = None, reviewer: str = "") -> None:
        """Open a folder; run: folder of the results of the experiment in `root` itself, default runs/<name>."""
        self.root = root.resolve()
        self.run = None if run is None else run.resolve()
        self.key = secrets.token_urlsafe(32)  # in the address of a recording, which only the page receives
        self._projects: dict[str, Project] = {}
        self._lock = threading.Lock()
        self.closed = False
        self.reviewer = reviewer  # who judged last

    def project(self, at: str) -> Project:
        """Return an experiment by its path from the root.

        Raises
        ------
        InputError
            There is no experiment, or it lies outside the root.
        """
        mistake = InputError(at, "", f"is no experiment below {self.root}")
        try:
            folder = (self.root / at).resolve()
            if not folder.is_relative_to(self.root) or not (folder / CONFIG_NAME).is_file():
                raise mistake
        except (OSError, ValueError):  # a name that no file can have
            raise mistake from None
        key = folder.relative_to(self.root).as_posix()
        with self._lock:
            if key not in self._projects:
                self._projects[key] = Project(self.root, folder, self.run if folder == self.root else None)
            found = self._projects[key]
        found.refuse_links()
        return found

    def close(self) -> None:
        """Pause every run; the same command resumes it."""
        self.closed = True
        for project in list(self._projects.values()):
            project.close()

    def home(self) -> dict[str, Any]:
        """Describe the first page: experiments, photographs that belong to none, the sample."""
        folders = find_experiments(self.root)
        listed = []
        for series in find_image_series(self.root):
            home, pattern, name = experiment_place(series, self.root)
            listed.append({
                "folder": series.folder.relative_to(self.root).as_posix(), "suffix": series.suffix,
                "count": len(series.files), "first": series.files[0].name, "last": series.files[-1].name, "name": name,
                "pattern": pattern, "home": home.relative_to(self.root).as_posix(),
            })  # fmt: skip
        return {
            "root": str(self.root), "version": __version__, "series": listed,
            "experiments": [self._overview(folder) for folder in folders],
            "sample": sample_folder() is not None and not any(each.name == "shear" for each in folders),
        }  # fmt: skip

    def _overview(self, folder: Path) -> dict[str, Any]:
        """Describe one experiment; a folder that cannot be read is shown as such, and takes no other with it."""
        at = folder.relative_to(self.root).as_posix()
        try:
            at.encode()
            return self.project(at).overview()
        except UnicodeEncodeError:
            error = "the name of this folder is not UTF-8: rename it"
        except InputError as refused:
            error = str(refused)
        return {"at": at, "name": folder.name, "run": None, "steps": [], "frames": 0, "error": error}

    def thumbnail(self, folder: str | None, suffix: str, widest: int) -> bytes:
        """Return the first photograph of a series as JPEG; folder None: of the sample."""
        if folder is None:
            source = sample_folder()
            files = [] if source is None else sorted((source / "photos").iterdir())[:1]
        else:
            files = list(find_series(self.root, folder, suffix).files[:1])
        if not files:
            raise InputError(self.root, "photographs", "are not there any more")
        return encode_jpeg(read_photograph(files[0]), widest)

    def begin(self, folder: str, suffix: str, name: str, like: str | None = None) -> Project:
        """Make an experiment of a series of photographs, named by their folder, not by their place in a list.

        like: the experiment whose set-up it takes over.
        """
        home, pattern, _ = experiment_place(find_series(self.root, folder, suffix), self.root)
        draft, source = Draft(home, root=self.root), None if like is None else self.project(like).validation()
        edits.begin(draft, valid_name(name), pattern)
        if source is not None:
            take_over(draft, source)
        return self.project(home.relative_to(self.root).as_posix())

    def duplicate(self, at: str) -> Project:
        """Copy an experiment into a new folder beside it."""
        target = duplicate(self.project(at).folder, self.root)
        return self.project(target.relative_to(self.root).as_posix())

    def sample(self) -> Project:
        """Copy the sample into the folder and open it."""
        return self.project(copy_sample(self.root).relative_to(self.root).as_posix())

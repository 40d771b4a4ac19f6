"""The actions of the workbench's page from Python: each request of the page is a method of an experiment."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ..experiment.experiment import CONFIG_NAME
from ..process.errors import InputError, RunError
from .running.job import JobState
from .service import server  # noqa: F401  importing it registers every endpoint
from .service.endpoints import ENDPOINTS, BadRequest, call_endpoint
from .service.workbench import Workbench
from .setup import edits
from .setup.draft import Draft

POLLING = 0.2  # [s] between two looks at a run


class Actions:
    """An experiment in a folder; every request of the page is a method with the same values.

    Examples
    --------
    >>> test = Actions("tests", "shear", files="photos/*.png", name="shear")
    >>> test.set_scale(line=[[10.0, 20.0], [510.0, 20.0]], metres=0.1)
    >>> test.run()
    """

    def __init__(self, root: Path | str, at: str = ".", *, files: str | None = None, name: str | None = None) -> None:
        """Open the experiment at a path below a folder.

        Parameters
        ----------
        root : Path or str
            The folder that the page would be opened on; results go to its `runs/`.
        at : str
            The experiment's path from there.
        files, name : str, optional
            Pattern of photographs and name of a new experiment, where there is none.

        Raises
        ------
        InputError
            There is no experiment, and no pattern to make one.
        """
        self.root, self.at = Path(root).resolve(), at
        folder = self.root / at
        if files is not None and not (folder / CONFIG_NAME).is_file():
            edits.begin(Draft(folder, root=self.root), name or folder.resolve().name, files)
        self._workbench = Workbench(self.root)
        self._workbench.project(at)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return a request of the page."""
        if name not in ENDPOINTS:
            raise AttributeError(f"the workbench has no action {name}")
        return partial(self._request, name)

    def text(self, file: str) -> str:
        """Return the content of a table in the experiment's folder."""
        return (self.root / self.at / file).read_text(encoding="utf-8")

    def run(self) -> None:
        """Run the experiment to its end. Raises RunError where it fails."""
        job = self._workbench.project(self.at).job
        self._request("run_start")
        while job.is_running:
            time.sleep(POLLING)
        if job.state is not JobState.FINISHED:
            raise RunError(f"the run is {job.state.value}: {' '.join(job.messages)[-500:]}")

    def _request(self, endpoint: str, **values: Any) -> Any:
        try:
            return call_endpoint(self._workbench, endpoint, {"at": self.at, **values})
        except BadRequest as error:
            raise InputError(endpoint, "", str(error)) from None

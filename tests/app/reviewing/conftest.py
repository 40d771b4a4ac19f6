"""The page as `rodsight review` opens it: the workbench's server on one run."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rodsight.results.hdf5.store import origin_of
from rodsight.reviewing.session import ReviewSession
from rodsight.run_folder import find_experiment
from rodsight.workbench.service.server import WorkbenchServer
from rodsight.workbench.service.workbench import Workbench


@contextmanager
def review_server(run: Path, reviewer: str = "anna") -> Iterator[WorkbenchServer]:
    """Serve the review of a run's folder, whose experiment lies elsewhere."""
    file = run / "results.h5"
    workbench = Workbench(find_experiment(file, origin_of(file)).parent, run=run, reviewer=reviewer)
    server = WorkbenchServer(workbench, command="review", entry="/#at=.&step=review")
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.close()


def session_of(server: WorkbenchServer) -> ReviewSession:
    """The review that a server serves."""
    return server.workbench.project(".").review_session()

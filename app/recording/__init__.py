"""Recordings: a run as one file that shows it all. The only importers of Rerun."""

from app.recording.blueprint import Layout, Tab, make_blueprint
from app.recording.canvas import Canvas
from app.recording.entities import SCHEMA, describe_schema
from app.recording.force_style import ForceRange, ForceStyle
from app.recording.network import SweepChoice
from app.recording.readback import RecordedForces, read_forces
from app.recording.recorder import Recorder, RecordingReport, layout_of, record
from app.recording.scene import Scene
from app.recording.viewer import ViewerKind, open_viewer, view_command

__all__ = [
    "SCHEMA",
    "Canvas",
    "ForceRange",
    "ForceStyle",
    "Layout",
    "RecordedForces",
    "Recorder",
    "RecordingReport",
    "Scene",
    "SweepChoice",
    "Tab",
    "ViewerKind",
    "describe_schema",
    "layout_of",
    "make_blueprint",
    "open_viewer",
    "read_forces",
    "record",
    "view_command",
]

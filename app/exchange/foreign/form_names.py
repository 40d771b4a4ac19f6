"""What forms of files there are; loads nothing, so that the list of commands may ask."""

from typing import Literal

Form = Literal["table", "trackpy", "trackmate", "rodtracker", "lammps", "yade", "pegs", "dic"]

"""The workbench: one local page to set up an experiment, run, inspect, review and correct it.

Every action of the page writes ordinary files of the experiment's folder, and the commands compute the same."""

"""An experiment that is being set up: its files edited with undo, every step validated as `rodsight check` does."""

"""An experiment that is being set up: its files edited with undo, and every step judged as `rodsight check` would.
Knows no page; stands on the experiment and on the detection of rods and walls."""

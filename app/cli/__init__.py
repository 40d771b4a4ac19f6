"""The `rodsight` command: one layer of commands over the stages. Nothing imports it."""

"""The `rodsight` command: commands that call the stages. No other folder imports it."""

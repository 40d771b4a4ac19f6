"""A run as a child process, the same `rodsight run` that a user types: started, paused, resumed, cancelled."""

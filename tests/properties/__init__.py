"""Laws that hold for any input, tested on generated inputs."""

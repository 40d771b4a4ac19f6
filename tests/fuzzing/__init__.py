"""What may come from outside: spoiled files, refused writes, kills, strangers. `python -m tests.fuzzing` counts."""

"""The results of a run: in memory, in results.h5, compared with the truth, in a summary. Depends on experiment."""

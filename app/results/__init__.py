"""What a run found out: in memory, in results.h5, against truth, in a summary. Stands on experiment."""

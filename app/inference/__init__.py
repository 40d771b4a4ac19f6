"""From tracks to forces: the one road for runs, sensitivity and studies. Depends on experiment."""

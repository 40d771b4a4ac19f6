"""Candidate pairs, the order in which they are judged, and the accuracy of the detector by the verdicts."""

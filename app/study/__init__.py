"""Studies on simulated truth: how accurate the forces are, and which of the paper's claims hold."""

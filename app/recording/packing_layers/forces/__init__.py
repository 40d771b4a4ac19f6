"""Forces over the packing: contact lines of every sweep, their colours and uncertainty, and the true forces."""

"""Forces over the packing: lines of contacts in every sweep, their colours, their doubt, the true ones beside them."""

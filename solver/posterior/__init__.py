"""The posterior of contacts, forces and centre errors from positions alone: an estimator that uses no motion."""

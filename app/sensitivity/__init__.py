"""How much the inferred forces depend on what nobody knows exactly: inputs varied, sequences solved again."""

"""Registration of one photograph against the references: prediction, fits, searches and consistency checks."""

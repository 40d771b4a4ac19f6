"""One photograph against the references: where every grain is expected, fitted, searched for, doubted."""

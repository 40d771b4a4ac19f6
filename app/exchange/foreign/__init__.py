"""Other programs' tables, dumps and spots, read as observations and made experiment folders.

Stands on experiment (tables, errors) and tracks; knows no solver but its shapes.
"""

"""results.h5: written frame by frame, read as it is asked for, of every version of the schema."""

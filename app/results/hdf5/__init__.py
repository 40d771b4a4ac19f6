"""Write results.h5 frame by frame, and read it on access, in every version of the schema."""

"""What all pictures of forces share: colours and range, marks of uncertainty, caption of a frame."""

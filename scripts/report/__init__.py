"""A page made of the rows of a benchmark."""

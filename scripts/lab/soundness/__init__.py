"""Random cases and whole episodes: is the truth ever lost? `make soundness`."""

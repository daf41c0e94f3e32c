"""Episodes of every strategy on the same objects, played in parallel and kept as rows."""

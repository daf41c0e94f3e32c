"""Speed and accuracy, each figure beside its goal: `make bench`, `make bench-touch`."""

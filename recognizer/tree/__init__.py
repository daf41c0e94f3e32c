"""The interpretation tree: bit sets of features, pruned by pairs, forward checking (memo, 2)."""

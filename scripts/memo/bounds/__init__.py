"""The memo's bounds on the size of the tree (Section 6)."""

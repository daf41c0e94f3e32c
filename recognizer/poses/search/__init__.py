"""Tree and model test as one search over a solid."""

"""Exact convex parts of objects, which MuJoCo collides with."""

"""Proofs that no pose in a region of rotations meets every bound."""

"""Pose errors beside the memo's Table V."""

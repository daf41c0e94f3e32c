"""Poses held against free space, a support and approaches."""

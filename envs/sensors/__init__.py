"""Sensors: what a probe feels, and the noise and bounds that it comes with."""

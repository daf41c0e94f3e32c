"""Interpretations that place an object alike are one hypothesis: its weight and its extent."""

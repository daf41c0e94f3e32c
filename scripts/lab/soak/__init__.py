"""Thousands of random and extreme steps in each environment: `make soak`."""

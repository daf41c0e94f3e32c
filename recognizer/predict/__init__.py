"""What poses that stand for a belief say a probe would meet."""

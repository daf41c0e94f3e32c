"""What developers measure with: soundness, soak and benchmarks. Not in the wheel."""

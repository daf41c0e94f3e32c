"""What to tell people: a verdict in words, why nothing fits, which parts look alike."""

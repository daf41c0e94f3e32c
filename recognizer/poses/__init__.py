"""What poses an interpretation allows, or a proof that it allows none (memo, 3)."""

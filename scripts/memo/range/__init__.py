"""Range data (memo, Section 5)."""

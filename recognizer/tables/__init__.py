"""Range tables: what two or three points on given features can be to each other (memo, 2.1)."""

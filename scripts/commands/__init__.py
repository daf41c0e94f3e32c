"""The commands of `palpate`, one a file."""

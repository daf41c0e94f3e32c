"""The commands of `palpate`, one file a command: parse, call, print."""

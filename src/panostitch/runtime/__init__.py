"""How things run, not what."""

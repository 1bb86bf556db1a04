"""The only code that opens photos and writes panoramas."""

"""The command line: the only code that knows click and prints. One file a command."""

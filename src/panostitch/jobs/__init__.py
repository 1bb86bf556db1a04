"""Uses of the pipeline: many folders at once, a test on known scenes, a comparison with another program."""

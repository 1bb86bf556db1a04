"""Uses of the pipeline: comparing it with another program, stitching many folders."""

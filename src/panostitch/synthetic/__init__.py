"""Scenes with known cameras: photographs of them, and the distance of a solution from the truth."""

"""The nouns: frozen dataclasses. No OpenCV, no disk."""

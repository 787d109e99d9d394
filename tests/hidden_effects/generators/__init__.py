"""Recordings by other authors' machines, for the blind protocol."""

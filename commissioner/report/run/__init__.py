"""The page of a run, and its result document."""

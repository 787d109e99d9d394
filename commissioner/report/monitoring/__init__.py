"""The page of a monitored recording."""

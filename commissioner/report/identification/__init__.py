"""The report of an identification from recordings: its values, and the pictures that a run's report shows of the same things."""

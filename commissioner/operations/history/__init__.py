"""Runs beside each other: which motor, what moved, how a motor does over the years, and where runs are taken to."""

"""Causes of the measurement: one file each."""

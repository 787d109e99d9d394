"""Causes of the stator: one file each."""

"""Causes of the iron: one file each."""

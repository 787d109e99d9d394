"""Causes of the rotor: one file each."""

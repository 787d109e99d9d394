"""Rotor, windings and shaft: how they lie, turn and warm."""

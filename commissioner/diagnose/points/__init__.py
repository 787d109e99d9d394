"""Steady test points, locked rotor or no load: the table, its circuits, their diagnosis."""

"""Converter, clock and recorder: when a current is taken, in which steps, and whether it is kept."""

"""Recordings of the simulated motor as a measuring chain stores them, with their answer keys."""

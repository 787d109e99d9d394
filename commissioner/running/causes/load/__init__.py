"""Causes in what the motor drives."""

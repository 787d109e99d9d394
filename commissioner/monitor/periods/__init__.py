"""Shaft and load periods from the currents alone."""

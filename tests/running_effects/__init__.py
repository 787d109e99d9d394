"""Blind cases of running motors: drawn by the simulator, diagnosed from the recording alone, scored against the answer key."""

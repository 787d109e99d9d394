"""What the simulation gets wrong: a recording in, named causes with size, gain, confidence and an extended model out."""

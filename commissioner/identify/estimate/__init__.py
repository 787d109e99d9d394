"""From fits to one motor: each axis, all axes, the inverter's law fitted to the samples."""

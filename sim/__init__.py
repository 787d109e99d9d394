"""A simulated open-firmware inverter with its motor: another author, another physics, another encoder."""

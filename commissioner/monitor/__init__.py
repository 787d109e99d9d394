"""A running motor from its terminals: currents and voltages in, speed, torque, load faults and indicators out."""

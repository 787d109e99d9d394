"""What the inverter loses: DC staircase, leg laws, and taking the loss off."""

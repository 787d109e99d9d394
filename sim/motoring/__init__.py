"""A motor that is started and loaded, with hidden effects by its own physics: machine, supply, shaft, sensors, draws."""

"""The simulated motor, its inverter's legs and its sensors: scenario facts in, fluxes, currents and readings out."""

"""From averaged lines to flux, speed, torque and parameters, each with its standard deviation."""

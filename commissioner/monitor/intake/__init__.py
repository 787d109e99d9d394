"""May this running recording carry an answer? Channels, clock, levels, sensors, findings."""

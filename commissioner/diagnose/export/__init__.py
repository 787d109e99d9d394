"""The extended model as files: what this product plays, and what the simulated inverter reads."""

"""Which combs belong to which load, at which mean speed, and which channel order is meant."""

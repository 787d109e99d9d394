"""What was recorded, and what can be said of it before any model: segments, audit, refusals, noise."""

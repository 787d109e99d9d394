"""What was recorded, what can be said of it before any model (segments, audit, refusals, noise), and how long it may be looked at."""

"""The current sensors: their zero, gain, form, speed, and what they pick up."""

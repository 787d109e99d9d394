"""What to drive, and how much of it: tones, amplitude, flux guard, closing bias."""

"""Lines of the mains, averages over a period, phases followed: what every later step reads."""

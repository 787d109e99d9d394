"""What a fit leaves of the currents: how much, in which state, and the lines in it that turn with the shaft."""

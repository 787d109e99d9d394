"""May this recording carry an answer? Rows, currents, stretches, plate."""

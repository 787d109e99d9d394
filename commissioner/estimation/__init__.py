"""One machine and one fit: the inverse-Gamma machine with a vector voltage, what may be added to it, its exact
sensitivities, and the fit of windows of a recording. In: windows of voltages, currents, speed. Out: numbers with covariance."""

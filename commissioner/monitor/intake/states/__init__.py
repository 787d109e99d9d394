"""What state the motor is in, stretch by stretch: levels over windows, a name for each window, stretches. In: a running recording; out: stretches."""

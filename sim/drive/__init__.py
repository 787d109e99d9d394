"""The simulated drive's firmware: register words in, states, parameters and a ring of samples out."""

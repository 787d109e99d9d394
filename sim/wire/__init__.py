"""How the simulated drive is reached: Modbus requests over TCP, TLS and serial lines in, answers and faults out."""

"""A drive behind libmodbus: its C source, and the process that a test starts."""

"""What the simulation gets wrong about a running motor, by name. In: recordings and a plate. Out: verdict, causes, sizes, gain."""

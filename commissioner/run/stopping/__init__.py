"""How a run is ended from outside: signals, the dead man's pipe of a service, a file in its folder."""

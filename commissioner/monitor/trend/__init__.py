"""A machine against its own past, and against an encoder where there is one."""

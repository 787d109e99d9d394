"""Groups of verbs of the command line: `runs`, `drives`, `recordings`, `accounts`."""

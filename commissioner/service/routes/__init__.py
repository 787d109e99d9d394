"""The HTTP contract, a file for each noun."""

"""The iron: main path, leakage path, what they remember and lose."""

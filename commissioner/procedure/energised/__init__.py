"""What happens to an energised motor: DC staircase in, tests with tones, closing bias; blocks and findings out."""

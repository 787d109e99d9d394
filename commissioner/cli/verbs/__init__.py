"""One verb a file: its options in, its screen and exit code out."""

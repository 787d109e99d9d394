"""The command line: options in; words, tables, JSON and exit codes out."""

"""Runs as the service sees them: started as child processes, followed by their journals, stopped by a word."""

"""The service as a process, and a technician at its page."""

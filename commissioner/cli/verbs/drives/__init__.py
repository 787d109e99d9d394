"""The verbs of `drives`: files as they are, a new one, conformance of firmware."""

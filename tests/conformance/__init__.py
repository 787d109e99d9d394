"""The conformance kit against two drives that conform, many that do not, and none at all."""

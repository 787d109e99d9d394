"""The page of a running motor's diagnosis or identification."""

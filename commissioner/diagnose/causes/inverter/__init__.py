"""The power stage: legs, link and cable."""

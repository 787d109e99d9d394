"""The technician's page, rendered here: it works without script; script makes it live."""

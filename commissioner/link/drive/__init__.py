"""A drive behind a port: items, readiness, write-back, de-energising."""

"""The parallel adaptive observer and what runs beside it, sample by sample."""

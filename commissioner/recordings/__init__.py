"""Recordings on disk: the table of the contract as CSV, gzipped CSV or Parquet, and importers into it."""

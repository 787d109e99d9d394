"""One short run of the product's own steps against the simulated drive, what is random in it, and its judge."""

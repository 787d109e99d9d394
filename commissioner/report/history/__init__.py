"""Pictures of a motor over the years."""

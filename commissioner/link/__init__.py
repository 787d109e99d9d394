"""The drive behind a wire: calls with physical values in, verified answers out."""

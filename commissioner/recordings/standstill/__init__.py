"""What a recording at standstill says otherwise than the contract: components of vectors, an axis, one segment."""

"""Reading what other people's instruments write: encoding, layout, numbers, names, units, and what was made of them."""

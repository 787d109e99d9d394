"""The joint least-squares fit of segments, its bound and the whiteness of what is left."""

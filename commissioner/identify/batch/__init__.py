"""The joint least-squares fit of segments and the whiteness of what is left."""

"""Closed forms of the machine at standstill that judge the product and that it does not need itself."""

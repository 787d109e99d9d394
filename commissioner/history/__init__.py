"""A motor over the years. Series of values with their standard errors in; trends, steps and alarms out, each with its chance."""

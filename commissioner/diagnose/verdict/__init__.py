"""From accepted causes to a verdict: evidence, lack of fit, names with their confidence, the next experiment."""

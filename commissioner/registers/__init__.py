"""Register words and physical values: words in, numbers, states and sample blocks out, and back."""

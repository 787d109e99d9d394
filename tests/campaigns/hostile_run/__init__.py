"""What `tests.campaigns.hostile` is made of: troubles, a man in the middle that makes them, one run judged by the truth."""

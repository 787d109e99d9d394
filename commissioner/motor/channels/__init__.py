"""Channels of a recording before they become vectors: what each may get wrong by itself, asked in one place for every verb."""

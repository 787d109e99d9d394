"""Pages that people keep: result documents in, self-contained HTML out."""

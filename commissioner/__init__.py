"""Self-commissioning drive service for induction motors."""

"""The archive under kills."""

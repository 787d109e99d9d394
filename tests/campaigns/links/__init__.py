"""Campaigns over slow links."""

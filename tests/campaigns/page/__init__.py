"""Campaigns on the service and its page: pictures of every view, stops at random instants, what it costs."""

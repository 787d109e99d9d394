"""The running machine compiled: trajectory and exact tangents. In a folder of its own, so that its cache outlives edits beside it."""

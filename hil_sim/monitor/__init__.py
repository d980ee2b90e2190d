"""A live view of a running system, from what is on its bus."""

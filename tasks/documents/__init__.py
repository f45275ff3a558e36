"""Pages and certificates that people read."""

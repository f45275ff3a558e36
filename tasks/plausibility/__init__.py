"""Whether what was delivered can be true, and which slip would explain it if not."""

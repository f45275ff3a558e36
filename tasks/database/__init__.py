"""Databases that something is kept in: where they are, how they are spoken to, what they complain about."""

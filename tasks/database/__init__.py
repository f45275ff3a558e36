"""Databases: addresses, connections and errors."""
